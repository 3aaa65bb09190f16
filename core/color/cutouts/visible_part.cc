#include "core/color/cutouts/visible_part.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/color/cutouts/hidden.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

// A polygon covers a texel if it reaches at least this deep into the texel, in texels.
constexpr double kDepth = 0x1p-16;
// sight() enlarges the cube by kCubeMargin lattice units (1/256 voxel), and the polygon's box by
// kBoxMargin texels. Both exceed all rounding errors.
constexpr double kCubeMargin = 0x1p-4, kBoxMargin = 0x1p-10;
// If rounding leaves no polygon in a voxel, the voxel is enlarged by this many lattice units.
constexpr double kVoxelMargin = 0x1p-6;
// A polygon that spans more than this many repetitions of the image is treated as covering all
// texels.
constexpr double kMaxPeriods = 16;
// The texels at the border of a clamped image extend to infinity. This coordinate stands for
// infinity.
constexpr double kEndless = 0x1p45;

std::array<int64_t, 3> low_corner(const Cube& cube, uint32_t grid_levels) {
  const int64_t units = cube.edge_voxels(grid_levels) * kUnitsPerVoxel;
  std::array<int64_t, 3> low;
  for (size_t a = 0; a < 3; ++a) low[a] = static_cast<int64_t>(cube.position[a]) * units;
  return low;
}

// Maps the coordinate `texel` (in texels) to a coordinate in the image. `period` is the number of
// the repetition of the image that contains `texel`; repetition 0 begins at coordinate 0.
double in_image(double texel, double period, double size, Wrap wrap) {
  const double at = texel - period * size;
  const bool is_mirrored = wrap == Wrap::kMirroredRepeat && std::fmod(period, 2) != 0;
  return is_mirrored ? size - at : at;
}

// A range of texels along an axis.
struct Range {
  uint32_t first, last;
};
// Returns a range that contains all texels from coordinate `low` to `high`.
Range texel_range(double low, double high, uint32_t size, Wrap wrap) {
  const double edge = size, first = std::floor(low / edge), last = std::floor(high / edge);
  const auto clamped = [&](double at) {
    return static_cast<uint32_t>(std::clamp(std::floor(at), 0.0, edge - 1));
  };
  if (wrap == Wrap::kClampToEdge) return {clamped(low), clamped(high)};
  if (first != last) return {0, size - 1};
  const double a = in_image(low, first, edge, wrap), b = in_image(high, first, edge, wrap);
  return {clamped(std::min(a, b)), clamped(std::max(a, b))};
}

}  // namespace

VisiblePart::VisiblePart(const FixedSurface& surface, const Cutouts& cutouts, uint32_t grid_levels)
    : triangle_(surface.position),
      mask_(cutouts.mask(surface.material)),
      wrap_(cutouts.materials[surface.material].wrap),
      grid_levels_(grid_levels),
      is_hidden_(color::is_hidden(cutouts.materials[surface.material], surface)) {
  if (!mask_) return;
  const double size[2] = {static_cast<double>(mask_->width()),
                          static_cast<double>(mask_->height())};
  for (size_t i = 0; i < 3; ++i)
    for (size_t a = 0; a < 2; ++a)
      texels_[i][a] = static_cast<double>(surface.corners[i].texture[a]) * (size[a] * 0x1p-24);
}

// Sets `inside` to the part of `from` on the inner side of a plane, on which the coordinate along
// `axis` is `bound`. A point is on the inner side if sign * (coordinate - bound) >= 0.
void VisiblePart::clip(const Polygon& from, int axis, double sign, double bound, Polygon& inside) {
  inside.count = 0;
  for (int i = 0; i < from.count && inside.count + 2 <= Polygon::kMaxPoints; ++i) {
    const Point& point = from.points[i];
    const Point& next = from.points[i + 1 == from.count ? 0 : i + 1];
    const double before = sign * (point.at[axis] - bound), after = sign * (next.at[axis] - bound);
    if (before >= 0) inside.points[inside.count++] = point;
    if ((before >= 0) == (after >= 0)) continue;
    const double share = before / (before - after);
    Point& crossing = inside.points[inside.count++];
    for (int a = 0; a < 3; ++a) crossing.at[a] = point.at[a] + share * (next.at[a] - point.at[a]);
    for (int a = 0; a < 2; ++a)
      crossing.texel[a] = point.texel[a] + share * (next.texel[a] - point.texel[a]);
    crossing.at[axis] = bound;
  }
}

// Returns the part of the triangle in a cube with the low corner `low` and the edge `edge`, in
// lattice units. First enlarges the cube by `margin` on all sides.
VisiblePart::Polygon VisiblePart::part_in(const std::array<int64_t, 3>& low, int64_t edge,
                                          double margin) const {
  Polygon parts[2];
  int current = 0;
  parts[0].count = 3;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t a = 0; a < 3; ++a)
      parts[0].points[i].at[a] = static_cast<double>(triangle_.v[i][a] - low[a]);
    for (size_t a = 0; a < 2; ++a) parts[0].points[i].texel[a] = texels_[i][a];
  }
  for (int side = 0; side < 6; ++side) {
    const Polygon& part = parts[current];
    const int axis = side / 2;
    const double sign = side % 2 == 0 ? 1 : -1;
    const double bound = side % 2 == 0 ? -margin : static_cast<double>(edge) + margin;
    bool is_inside = true;  // if true, clip() would only copy the part
    for (int i = 0; i < part.count; ++i) is_inside &= sign * (part.points[i].at[axis] - bound) >= 0;
    if (is_inside) continue;
    clip(part, axis, sign, bound, parts[1 - current]);
    current = 1 - current;
  }
  return parts[current];
}

VisiblePart::Sight VisiblePart::sight(const Cube& cube) const {
  if (is_hidden_) return Sight::kHidden;
  if (!mask_) return Sight::kVisible;
  const int64_t edge = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  return sight_of(part_in(low_corner(cube, grid_levels_), edge, kCubeMargin));
}

// Returns kVisible if all texels in the polygon's box are visible, kHidden if none are, and
// otherwise kMixed. Tests the blocks of the finest level (alpha_mask.h) at which the box is at most
// five blocks wide and high.
VisiblePart::Sight VisiblePart::sight_of(const Polygon& polygon) const {
  if (polygon.count == 0) return Sight::kMixed;
  Range range[2];
  for (int a = 0; a < 2; ++a) {
    double low = polygon.points[0].texel[a], high = low;
    for (int i = 1; i < polygon.count; ++i) {
      low = std::min(low, polygon.points[i].texel[a]);
      high = std::max(high, polygon.points[i].texel[a]);
    }
    const uint32_t size = a == 0 ? mask_->width() : mask_->height();
    range[a] =
        texel_range(low - kBoxMargin, high + kBoxMargin, size, wrap_[static_cast<size_t>(a)]);
  }
  constexpr uint32_t kBlocks = 4;
  uint32_t level = 0;
  while (((range[0].last - range[0].first) >> level) >= kBlocks ||
         ((range[1].last - range[1].first) >> level) >= kBlocks)
    ++level;
  bool any = false, all = true;
  for (uint32_t y = range[1].first >> level; y <= range[1].last >> level; ++y)
    for (uint32_t x = range[0].first >> level; x <= range[0].last >> level; ++x) {
      any |= mask_->any_visible(level, x, y);
      all &= mask_->all_visible(level, x, y);
    }
  return all ? Sight::kVisible : any ? Sight::kMixed : Sight::kHidden;
}

bool VisiblePart::is_visible(const std::array<int64_t, 3>& voxel) const {
  if (is_hidden_) return false;
  if (!mask_) return true;
  const std::array<int64_t, 3> low{voxel[0] * kUnitsPerVoxel, voxel[1] * kUnitsPerVoxel,
                                   voxel[2] * kUnitsPerVoxel};
  Polygon polygon = part_in(low, kUnitsPerVoxel, 0);
  if (polygon.count == 0) polygon = part_in(low, kUnitsPerVoxel, kVoxelMargin);
  if (covers(polygon, true, kDepth)) return true;
  return !covers(polygon, false, kDepth) && covers(polygon, true, -kDepth);
}

bool VisiblePart::is_visible_in(const Cube& cube) const {
  const Sight here = sight(cube);
  if (here != Sight::kMixed) return here == Sight::kVisible;
  if (cube.level == grid_levels_)
    return is_visible({cube.position[0], cube.position[1], cube.position[2]});
  const int64_t units = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  for (uint32_t mask = touched_children(triangle_, cube, units); mask; mask &= mask - 1)
    if (is_visible_in(cube.child(lowest_bit(mask)))) return true;
  return false;
}

bool VisiblePart::covers(const Polygon& polygon, bool visible, double depth) const {
  if (polygon.count == 0) return false;
  const uint32_t top = mask_->levels() - 1;
  double first[2] = {}, last[2] = {};
  const double size[2] = {static_cast<double>(mask_->width()),
                          static_cast<double>(mask_->height())};
  for (int a = 0; a < 2; ++a) {
    if (wrap_[static_cast<size_t>(a)] == Wrap::kClampToEdge) continue;
    double low = polygon.points[0].texel[a], high = low;
    for (int i = 1; i < polygon.count; ++i) {
      low = std::min(low, polygon.points[i].texel[a]);
      high = std::max(high, polygon.points[i].texel[a]);
    }
    first[a] = std::floor((low - 2 * kDepth) / size[a]);
    last[a] = std::floor((high + 2 * kDepth) / size[a]);
    if (last[a] - first[a] >= kMaxPeriods)
      return visible ? mask_->any_visible(top, 0, 0) : !mask_->all_visible(top, 0, 0);
  }
  for (double v = first[1]; v <= last[1]; ++v)
    for (double u = first[0]; u <= last[0]; ++u) {
      const Outline outline = outline_of(polygon, {u, v});
      const Block block = block_around(outline);
      if (covers(outline, visible, depth, block.level, block.x, block.y)) return true;
    }
  return false;
}

// Returns the outline of a polygon relative to one repetition of the image, in the coordinates of
// the image's texels. `period` has the repetition's numbers along u and v.
VisiblePart::Outline VisiblePart::outline_of(const Polygon& polygon,
                                             const std::array<double, 2>& period) const {
  Outline out;
  out.count = polygon.count;
  const uint32_t size[2] = {mask_->width(), mask_->height()};
  double at[Polygon::kMaxPoints][2];
  for (size_t a = 0; a < 2; ++a) {
    for (int i = 0; i < out.count; ++i)
      at[i][a] = in_image(polygon.points[i].texel[a], period[a], size[a], wrap_[a]);
    out.low[a] = out.high[a] = at[0][a];
    for (int i = 1; i < out.count; ++i) {
      out.low[a] = std::min(out.low[a], at[i][a]);
      out.high[a] = std::max(out.high[a], at[i][a]);
    }
  }
  for (int i = 0; i < out.count; ++i) {
    const double* const from = at[i];
    const double* const to = at[i + 1 == out.count ? 0 : i + 1];
    Outline::Edge& edge = out.edges[i];
    edge = {to[1] - from[1], from[0] - to[0], {from[0], from[1]}, 0, 0};
    for (int k = 0; k < out.count; ++k) {
      const double side = edge.nu * (at[k][0] - from[0]) + edge.nv * (at[k][1] - from[1]);
      edge.least = std::min(edge.least, side);
      edge.most = std::max(edge.most, side);
    }
  }
  return out;
}

// Returns the smallest block that contains the polygon and a margin around it. If no block contains
// them, returns the block of the last level. The polygon does not reach beyond the returned block.
// So covers() has the same result for this block as for every larger block that contains it.
VisiblePart::Block VisiblePart::block_around(const Outline& outline) const {
  const uint32_t size[2] = {mask_->width(), mask_->height()};
  uint32_t first[2], last[2];
  for (int a = 0; a < 2; ++a) {
    const double low = outline.low[a] - kBoxMargin, high = outline.high[a] + kBoxMargin;
    if (!(low >= 0 && high < size[a])) return {mask_->levels() - 1, 0, 0};
    first[a] = static_cast<uint32_t>(low);
    last[a] = static_cast<uint32_t>(high);
  }
  const auto level =
      static_cast<uint32_t>(std::bit_width((first[0] ^ last[0]) | (first[1] ^ last[1])));
  return {level, first[0] >> level, first[1] >> level};
}

// Returns the square of a block of texels, made smaller by `depth` on all sides.
VisiblePart::Box VisiblePart::square_of(uint32_t level, uint32_t x, uint32_t y,
                                        double depth) const {
  const uint32_t at[2] = {x, y}, size[2] = {mask_->width(), mask_->height()};
  Box box;
  for (size_t a = 0; a < 2; ++a) {
    const uint64_t begin = uint64_t{at[a]} << level, end = uint64_t{at[a] + 1} << level;
    box.low[a] = static_cast<double>(begin) + depth;
    box.high[a] = static_cast<double>(std::min<uint64_t>(end, size[a])) - depth;
    if (wrap_[a] != Wrap::kClampToEdge) continue;
    if (begin == 0) box.low[a] = -kEndless;
    if (end >= size[a]) box.high[a] = kEndless;
  }
  return box;
}

bool VisiblePart::covers(const Outline& outline, bool visible, double depth, uint32_t level,
                         uint32_t x, uint32_t y) const {
  const bool any = visible ? mask_->any_visible(level, x, y) : !mask_->all_visible(level, x, y);
  if (!any) return false;
  const Box box = square_of(level, x, y, depth);
  for (int a = 0; a < 2; ++a)
    if (outline.high[a] < box.low[a] || outline.low[a] > box.high[a]) return false;
  // The polygon misses the box if an edge of the polygon separates them: the box is on one side of
  // the edge, and all corners of the polygon are on the other side.
  for (int i = 0; i < outline.count; ++i) {
    const auto& [nu, nv, from, least, most] = outline.edges[i];
    const double low = nu * ((nu > 0 ? box.low[0] : box.high[0]) - from[0]) +
                       nv * ((nv > 0 ? box.low[1] : box.high[1]) - from[1]);
    const double high = nu * ((nu > 0 ? box.high[0] : box.low[0]) - from[0]) +
                        nv * ((nv > 0 ? box.high[1] : box.low[1]) - from[1]);
    if (low > most || high < least) return false;
  }
  const bool all = visible ? mask_->all_visible(level, x, y) : !mask_->any_visible(level, x, y);
  if (all || level == 0) return true;
  for (uint32_t j = 2 * y; j < std::min(2 * y + 2, mask_->height(level - 1)); ++j)
    for (uint32_t i = 2 * x; i < std::min(2 * x + 2, mask_->width(level - 1)); ++i)
      if (covers(outline, visible, depth, level - 1, i, j)) return true;
  return false;
}

}  // namespace voxdag
