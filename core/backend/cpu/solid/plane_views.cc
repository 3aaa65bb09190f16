#include "core/backend/cpu/solid/plane_views.h"

#include <algorithm>

#include "core/backend/cpu/raster/voxel_block.h"

namespace voxdag::cpu {
namespace {

constexpr int kBlocks = RunningRows::kRows - 1;  // blocks along a tile's edge

// True if points on the plane count as above it. The rule of crossings decides this, because it
// moves every point by an infinitely small vector (core/geometry/crossing.h).
bool ties_are_above(const Plane& plane) {
  return (plane.n[0] != 0 ? plane.n[0] : plane.n[1] != 0 ? plane.n[1] : plane.n[2]) > 0;
}

bool is_inside(int32_t views) { return UnitViews{views, 1}.is_inside(); }
bool is_disputed(int32_t views) { return UnitViews{views, 1}.is_disputed(); }

// Returns the plane's value at the low corner of a cube. A corner of a block is above the plane iff
// its value is >= 0. `f` is the plane's offset from the cube.
int64_t value_at_low(const Plane& plane, int64_t f) {
  return f - (plane.fractional || ties_are_above(plane) ? 0 : 1);
}

// Returns the inner sides; nullopt if both are inside the solid but only one of them is disputed.
// `has[side]`: true if corners of blocks are on this side (0: below, 1: above). `views[side]`: the
// sum of the three views from each of these corners. If no corner is on a side, this side counts as
// outside. All its voxels are in the shell, so there is nothing to fill.
std::optional<PlaneViews::Sides> sides_of(const bool (&has)[2], const int32_t (&views)[2]) {
  const InnerSides inner{has[0] && is_inside(views[0]), has[1] && is_inside(views[1])};
  const bool below = inner.below && is_disputed(views[0]);
  const bool above = inner.above && is_disputed(views[1]);
  if (inner.below && inner.above && below != above) return {};
  return PlaneViews::Sides{inner, below || above};
}

}  // namespace

bool PlaneViews::Face::has(bool is_above) const {
  for (const int i : {0, kBlocks})
    for (const int j : {0, kBlocks})
      if ((at(i, j) >= 0) == is_above) return true;
  return false;
}

PlaneViews::Face PlaneViews::face(int axis, bool is_high) const {
  return {base_ + (is_high ? kBlocks * step_[axis] : 0), step_[first_row_axis(axis)],
          step_[second_row_axis(axis)]};
}

std::optional<PlaneViews::Sides> PlaneViews::read(const Plane& plane, int64_t f, bool is_turned,
                                                  const int (&tile)[3]) {
  base_ = value_at_low(plane, f);
  int64_t lowest = base_, highest = base_;
  for (int a = 0; a < 3; ++a) {
    step_[a] = plane.n[a] * (int64_t{1} << kBlockLog2);
    (step_[a] < 0 ? lowest : highest) += kBlocks * step_[a];
  }
  for (int a = 0; a < 3; ++a) {
    rows_[a] = running_.column(a, tile);
    if (!read(a, is_turned)) return {};
  }
  int32_t sums[2] = {0, 0};
  for (const auto& views : views_)
    for (int side = 0; side < 2; ++side) sums[side] += views[side];
  return sides_of({lowest < 0, highest >= 0}, sums);
}

std::optional<PlaneViews::Sides> PlaneViews::read_part(const TileViews& views, const Plane& plane,
                                                       int64_t f, const int (&low)[3], int edge) {
  int64_t step[3];
  for (int a = 0; a < 3; ++a) step[a] = plane.n[a] * (int64_t{1} << kBlockLog2);
  const int64_t base = value_at_low(plane, f);
  bool has[2] = {false, false};
  int32_t sums[2] = {0, 0};
  for (int x = 0; x <= edge; ++x)
    for (int y = 0; y <= edge; ++y) {
      int64_t value = base + x * step[0] + y * step[1];
      for (int z = 0; z <= edge; ++z, value += step[2]) {
        const bool is_above = value >= 0;
        const int32_t sum = views.at(low[0] + x, low[1] + y, low[2] + z);
        if (!has[is_above]) sums[is_above] = sum;
        has[is_above] = true;
        if (sums[is_above] != sum &&
            TileViews::class_of(sums[is_above]) != TileViews::class_of(sum))
          return {};
      }
    }
  return sides_of(has, sums);
}

// Sets views_[axis] to the views of the rows below and above the plane. Returns false if rows on
// the same side of the plane have different views.
bool PlaneViews::read(int axis, bool is_turned) {
  const Face low = face(axis, false);
  const int32_t* rows = rows_[axis];
  int32_t(&views)[2] = views_[axis];
  const bool has[2] = {low.has(false), low.has(true)};
  for (const int i : {0, kBlocks})
    for (const int j : {0, kBlocks}) views[low.at(i, j) >= 0] = rows[kRows * i + j];
  if (step_[axis] != 0) {
    const int before = step_[axis] > 0 ? 0 : 1;
    const int sign = (step_[axis] > 0) == is_turned ? 1 : -1;
    const int32_t behind = view_after(rule_, views[before], sign);
    if (has[before] && has[1 - before] && views[1 - before] != behind) return false;
    if (has[before]) views[1 - before] = behind;
  }
  uint32_t differ = 0;
  if (has[0] != has[1]) {
    const int32_t view = views[has[1]];
    for (int row = 0; row < RunningRows::kSquare; ++row)
      differ |= static_cast<uint32_t>(rows[row] ^ view);
    return differ == 0;
  }
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; j < kRows; ++j)
      differ |= static_cast<uint32_t>(rows[kRows * i + j] ^ views[low.at(i, j) >= 0]);
  return differ == 0;
}

void PlaneViews::advance() {
  for (int a = 0; a < 3; ++a) {
    if (step_[a] == 0) continue;
    const Face low = face(a, false), high = face(a, true);
    const bool has[2] = {high.has(false), high.has(true)};
    if (has[0] && has[1]) {
      for (int i = 0; i < kRows; ++i)
        for (int j = 0; j < kRows; ++j) rows_[a][kRows * i + j] = views_[a][high.at(i, j) >= 0];
    } else if (low.has(!has[1])) {
      std::fill(rows_[a], rows_[a] + RunningRows::kSquare, views_[a][has[1]]);
    }
  }
}

}  // namespace voxdag::cpu
