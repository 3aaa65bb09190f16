#include "core/color/cutouts/visible_voxels.h"

#include <bit>
#include <cmath>

#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

using Sight = VisiblePart::Sight;

// Returns the axis along which the triangle's plane rises least, so that segments are long.
size_t flattest_axis(const FixedTriangle& triangle) {
  double normal[3];
  for (int a = 0; a < 3; ++a) {
    const auto edge = [&](int i, int axis) {
      return static_cast<double>(triangle.v[i][axis] - triangle.v[0][axis]);
    };
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    normal[a] = std::abs(edge(1, b) * edge(2, c) - edge(1, c) * edge(2, b));
  }
  size_t axis = 2;
  for (const size_t a : {1, 0})
    if (normal[a] < normal[axis]) axis = a;
  return axis;
}

// Returns an odd coordinate near the middle of a voxel.
int64_t inside_voxel(int64_t voxel) { return voxel * kUnitsPerVoxel + kUnitsPerVoxel / 2 + 1; }

}  // namespace

VisibleVoxels::VisibleVoxels(const VisiblePart& part, uint32_t grid_levels)
    : part_(part),
      grid_levels_(grid_levels),
      block_level_(grid_levels > kBlockLevels ? grid_levels - kBlockLevels : 0),
      along_(flattest_axis(part.triangle())) {}

bool VisibleVoxels::for_each_segment(const Visit& visit) {
  const CellBox box(part_.triangle(), grid_levels_, block_level_);
  const Cube start = box.is_inside_grid() ? box.cube_around() : Cube{};
  const int64_t edge = start.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  int64_t low[3];
  for (int a = 0; a < 3; ++a) low[a] = static_cast<int64_t>(start.position[a]) * edge;
  return !triangle_touches_cube(part_.triangle(), low, edge) || descend(start, false, visit);
}

// Visits the segments in a cube. `is_visible`: the triangle is known to be visible in all voxels of
// the cube that it touches.
bool VisibleVoxels::descend(const Cube& cube, bool is_visible, const Visit& visit) {
  if (!is_visible) {
    const Sight sight = part_.sight(cube);
    if (sight == Sight::kHidden) return true;
    is_visible = sight == Sight::kVisible;
  }
  if (cube.level == block_level_) {
    rows_.fill(0);
    mark(cube, is_visible);
    std::array<int64_t, 3> low;
    for (size_t a = 0; a < 3; ++a)
      low[a] = int64_t{cube.position[a]} << (grid_levels_ - cube.level);
    return visit_rows(low, visit);
  }
  const int64_t units = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  for (uint32_t mask = touched_children(part_.triangle(), cube, units); mask; mask &= mask - 1)
    if (!descend(cube.child(lowest_bit(mask)), is_visible, visit)) return false;
  return true;
}

// Sets the bits of the visible voxels in a cube. The cube is a block or a part of a block.
void VisibleVoxels::mark(const Cube& cube, bool is_visible) {
  if (!is_visible) {
    const Sight sight = part_.sight(cube);
    if (sight == Sight::kHidden) return;
    is_visible = sight == Sight::kVisible;
  }
  if (cube.level == grid_levels_) {
    const uint32_t* const at = cube.position;
    if (!is_visible && !part_.is_visible({at[0], at[1], at[2]})) return;
    constexpr uint32_t kMask = kBlockEdge - 1;
    const size_t row = (at[(along_ + 1) % 3] & kMask) * kBlockEdge + (at[(along_ + 2) % 3] & kMask);
    rows_[row] = static_cast<uint16_t>(rows_[row] | 1u << (at[along_] & kMask));
    return;
  }
  const int64_t units = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  for (uint32_t mask = touched_children(part_.triangle(), cube, units); mask; mask &= mask - 1)
    mark(cube.child(lowest_bit(mask)), is_visible);
}

bool VisibleVoxels::visit_rows(const std::array<int64_t, 3>& low, const Visit& visit) const {
  const size_t across = (along_ + 1) % 3, up = (along_ + 2) % 3;
  for (size_t row = 0; row < rows_.size(); ++row) {
    uint32_t bits = rows_[row];
    while (bits != 0) {
      const int first = std::countr_zero(bits);
      const int count = std::countr_one(bits >> first);
      bits &= ~(((1u << count) - 1) << first);
      FixedTriangle segment;
      for (size_t i = 0; i < 3; ++i) {
        segment.v[i][along_] = inside_voxel(low[along_] + first + (i > 0 ? count - 1 : 0));
        segment.v[i][across] = inside_voxel(low[across] + static_cast<int64_t>(row) / kBlockEdge);
        segment.v[i][up] = inside_voxel(low[up] + static_cast<int64_t>(row) % kBlockEdge);
      }
      if (!visit(segment)) return false;
    }
  }
  return true;
}

}  // namespace voxdag
