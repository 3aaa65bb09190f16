#include "core/color/patches/visible_patches.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

using Sight = VisiblePart::Sight;

// A rectangle of up to this many rows becomes one segment (a degenerate triangle) per row. A larger
// rectangle becomes two triangles.
constexpr size_t kMaxSegments = 2;

// Returns an odd coordinate near the middle of a voxel.
int64_t inside_voxel(int64_t voxel) { return voxel * kUnitsPerVoxel + kUnitsPerVoxel / 2 + 1; }

// True if the bits from `first` to `first + count - 1` are set, and the bits next to them are not.
bool has_run(uint64_t bits, int first, int count) {
  return (bits >> first & 1) != 0 && std::countr_one(bits >> first) == count &&
         (first == 0 || (bits >> (first - 1) & 1) == 0);
}

}  // namespace

VisiblePatches::VisiblePatches(uint32_t grid_levels)
    : grid_levels_(grid_levels),
      block_level_(grid_levels > kBlockLevels ? grid_levels - kBlockLevels : 0),
      rows_(kBlockEdge * kBlockEdge) {}

// Chooses the axes for a triangle. Rows are along the axis of the normal's smallest component, and
// layers are perpendicular to the axis of its largest component. This makes rows and rectangles
// large.
VisiblePatches::Axes VisiblePatches::axes_of(const FixedTriangle& triangle) {
  double normal[3];
  for (int a = 0; a < 3; ++a) {
    const auto edge = [&](int i, int axis) {
      return static_cast<double>(triangle.v[i][axis] - triangle.v[0][axis]);
    };
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    normal[a] = std::abs(edge(1, b) * edge(2, c) - edge(1, c) * edge(2, b));
  }
  size_t order[3] = {2, 1, 0};
  std::stable_sort(order, order + 3, [&](size_t a, size_t b) { return normal[a] < normal[b]; });
  return {order[0], order[1], order[2]};
}

bool VisiblePatches::for_each(const VisiblePart& part, const Visit& visit) {
  const FixedTriangle& triangle = part.triangle();
  const CellBox box(triangle, grid_levels_, grid_levels_);
  const Cube start = box.is_inside_grid() ? box.cube_around() : Cube{};
  const int64_t edge = start.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  int64_t low[3];
  for (int a = 0; a < 3; ++a) low[a] = static_cast<int64_t>(start.position[a]) * edge;
  if (!triangle_touches_cube(triangle, low, edge)) return true;
  axes_ = axes_of(triangle);
  return descend({part, TouchedVoxels(triangle), visit}, start, false);
}

// Visits the patches in a cube. `is_visible` is true if the triangle is known to be visible in all
// voxels of the cube that it touches.
bool VisiblePatches::descend(const Source& source, const Cube& cube, bool is_visible) {
  if (cube.level >= block_level_) {
    mark_visible(source, cube, is_visible);
    const Cube block = ancestor(cube, block_level_);
    Voxel low;
    for (size_t a = 0; a < 3; ++a)
      low[a] = int64_t{block.position[a]} << (grid_levels_ - block_level_);
    return visit_rows(low, source.visit);
  }
  if (!is_visible) {
    const Sight sight = source.part.sight(cube);
    if (sight == Sight::kHidden) return true;
    is_visible = sight == Sight::kVisible;
  }
  const int64_t units = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  for (uint32_t mask = touched_children(source.part.triangle(), cube, units); mask;
       mask &= mask - 1)
    if (!descend(source, cube.child(lowest_bit(mask)), is_visible)) return false;
  return true;
}

// Marks the visible voxels of a cube in rows_. The cube is a block (64^3 voxels) or a part of one.
void VisiblePatches::mark_visible(const Source& source, const Cube& cube, bool is_visible) {
  if (!is_visible) {
    const Sight sight = source.part.sight(cube);
    if (sight == Sight::kHidden) return;
    is_visible = sight == Sight::kVisible;
  }
  const int64_t edge = cube.edge_voxels(grid_levels_);
  const Voxel low{cube.position[0] * edge, cube.position[1] * edge, cube.position[2] * edge};
  if (edge == 1) {
    if (is_visible || source.part.is_visible(low)) mark(low);
    return;
  }
  if (is_visible)
    return source.touched.for_each(low, edge, [this](const Voxel& voxel) { mark(voxel); });
  for (uint32_t mask = touched_children(source.part.triangle(), cube, edge * kUnitsPerVoxel); mask;
       mask &= mask - 1)
    mark_visible(source, cube.child(lowest_bit(mask)), false);
}

void VisiblePatches::mark(const Voxel& voxel) {
  constexpr uint64_t kMask = kBlockEdge - 1;
  const auto at = [&](size_t axis) { return static_cast<uint64_t>(voxel[axis]) & kMask; };
  const size_t row = at(axes_.across) * kBlockEdge + at(axes_.aside);
  rows_[row] |= uint64_t{1} << at(axes_.along);
  first_row_ = std::min(first_row_, row);
  last_row_ = std::max(last_row_, row);
}

// Visits the patches of the block whose low corner is `low`, and clears rows_.
bool VisiblePatches::visit_rows(const Voxel& low, const Visit& visit) {
  bool is_complete = true;
  for (size_t row = first_row_; row <= last_row_; ++row)
    while (is_complete && rows_[row] != 0) is_complete = visit_run(low, row, visit);
  if (!is_complete) std::ranges::fill(rows_, 0);
  first_row_ = rows_.size();
  last_row_ = 0;
  return is_complete;
}

// Takes the first run (of consecutive visible voxels) of a row, and the equal runs in the next rows
// of the layer. Visits the patches of these runs, and removes the runs from rows_.
bool VisiblePatches::visit_run(const Voxel& low, size_t row, const Visit& visit) {
  const int first = std::countr_zero(rows_[row]);
  const int count = std::countr_one(rows_[row] >> first);
  const uint64_t bits = ~uint64_t{0} >> (static_cast<int>(kBlockEdge) - count) << first;
  size_t height = 0;
  const size_t end_of_layer = (row / kBlockEdge + 1) * kBlockEdge;
  for (size_t next = row; next < end_of_layer && has_run(rows_[next], first, count); ++next) {
    rows_[next] &= ~bits;
    ++height;
  }
  const auto corner = [&](size_t along, size_t aside, int64_t(&at)[3]) {
    at[axes_.along] = inside_voxel(low[axes_.along] + first + static_cast<int64_t>(along));
    at[axes_.aside] =
        inside_voxel(low[axes_.aside] + static_cast<int64_t>(row % kBlockEdge + aside));
    at[axes_.across] = inside_voxel(low[axes_.across] + static_cast<int64_t>(row / kBlockEdge));
  };
  const size_t width = static_cast<size_t>(count);
  const auto patch = [&](std::array<size_t, 2> a, std::array<size_t, 2> b,
                         std::array<size_t, 2> c) {
    FixedTriangle triangle;
    corner(a[0], a[1], triangle.v[0]);
    corner(b[0], b[1], triangle.v[1]);
    corner(c[0], c[1], triangle.v[2]);
    return visit(triangle);
  };
  const size_t right = width - 1, top = height - 1;
  if (right == 0) return patch({0, 0}, {0, top}, {0, top});
  if (height > kMaxSegments)
    return patch({0, 0}, {right, 0}, {right, top}) && patch({0, 0}, {right, top}, {0, top});
  for (size_t aside = 0; aside < height; ++aside)
    if (!patch({0, aside}, {right, aside}, {right, aside})) return false;
  return true;
}

}  // namespace voxdag
