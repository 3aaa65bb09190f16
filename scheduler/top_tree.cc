#include "scheduler/top_tree.h"

#include <algorithm>
#include <cmath>

#include "core/backend/backend.h"
#include "core/dag/brick.h"
#include "core/geometry/morton.h"
#include "scheduler/cube_walk.h"

namespace voxdag {
namespace {

// Cells are no smaller, in voxels an edge: finer ones cost more than they tell about a scene.
constexpr int64_t kLeastCellEdge = 2 * kSmallestEdge;

// Cubes of 2^shift units an edge.
double expected_cubes(const FixedTriangle& t, int shift) {
  const double scale = 1.0 / static_cast<double>(int64_t{1} << shift);
  double e[2][3], extents = 0;
  for (int a = 0; a < 3; ++a) {
    e[0][a] = static_cast<double>(t.v[1][a] - t.v[0][a]) * scale;
    e[1][a] = static_cast<double>(t.v[2][a] - t.v[0][a]) * scale;
    extents += static_cast<double>(t.high(a) - t.low(a)) * scale;
  }
  double area = 0;  // of the three projections, summed: area * (|nx| + |ny| + |nz|)
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    area += 0.5 * std::abs(e[0][b] * e[1][c] - e[0][c] * e[1][b]);
  }
  return area + extents + 1;
}

}  // namespace

double expected_bricks(const FixedTriangle& t) {
  return expected_cubes(t, kUnitBits + kBrickLevels);
}

double expected_voxels(const FixedTriangle& t) { return expected_cubes(t, kUnitBits); }

uint32_t TopTree::depth_within(uint32_t grid_levels, uint64_t bytes) {
  uint32_t depth = 0;
  while (depth < kDeepest && (int64_t{1} << (grid_levels - depth)) > kLeastCellEdge &&
         (sizeof(Cell) << (3 * (depth + 1))) <= bytes)
    ++depth;
  return depth;
}

TopTree::TopTree(uint32_t grid_levels, uint32_t depth, MemoryBudget& budget)
    : grid_levels_(grid_levels),
      depth_(depth),
      cells_(budget, size_t{1} << (3 * depth), "the top tree's counters") {}

void TopTree::add(const FixedTriangle& triangle) {
  touched_.clear();
  // Straight to the smallest cube that holds the triangle's box, if that is inside the grid.
  Cube cube;
  const int shift = kUnitBits + static_cast<int>(grid_levels_ - depth_);
  const int64_t end = int64_t{1} << depth_;
  uint32_t differ = 0;
  bool inside = true;
  uint32_t cell[3] = {};
  for (int a = 0; a < 3; ++a) {
    const int64_t low = triangle.low(a) >> shift, high = triangle.high(a) >> shift;
    inside &= low >= 0 && high < end;
    cell[a] = static_cast<uint32_t>(low);
    differ |= static_cast<uint32_t>(low ^ high);
  }
  if (inside) {
    uint32_t up = 0;
    while (differ >> up) ++up;
    cube = {depth_ - up, {cell[0] >> up, cell[1] >> up, cell[2] >> up}};
  }
  collect(triangle, cube, morton_encode(cube.position[0], cube.position[1], cube.position[2]));
  if (touched_.empty()) return;
  const double weight = expected_bricks(triangle);
  const float each = static_cast<float>(weight / static_cast<double>(touched_.size()));
  for (const uint64_t code : touched_) {
    cells_[code].weight += each;
    if (cells_[code].triangles < UINT32_MAX) ++cells_[code].triangles;
  }
  total_weight_ += weight;
}

void TopTree::collect(const FixedTriangle& triangle, const Cube& cube, uint64_t code) {
  if (cube.level == depth_) {
    touched_.push_back(code);
    return;
  }
  const int64_t units = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
  for (uint32_t mask = touched_children(triangle, cube, units); mask; mask &= mask - 1) {
    const int c = lowest_bit(mask);
    collect(triangle, cube.child(c), code * 8 + static_cast<uint64_t>(c));
  }
}

uint64_t TopTree::occupied_cells() const {
  uint64_t occupied = 0;
  for (size_t i = 0; i < cells_.size(); ++i) occupied += cells_[i].triangles > 0;
  return occupied;
}

// Bottom-up: a cube whose children all came back whole, and that `keep_whole` accepts, replaces
// them.
template <class KeepWhole>
SubvolumePlan TopTree::gather(const Cube& cube, uint64_t code, const KeepWhole& keep_whole,
                              std::vector<SubvolumePlan>& out) const {
  SubvolumePlan sum;
  sum.cube = cube;
  const size_t first = out.size();
  if (cube.level == depth_) {
    sum.weight = cells_[code].weight;
    sum.triangles = cells_[code].triangles;
  } else {
    for (int c = 0; c < 8; ++c) {
      const SubvolumePlan part =
          gather(cube.child(c), code * 8 + static_cast<uint64_t>(c), keep_whole, out);
      sum.weight += part.weight;
      sum.triangles += part.triangles;
    }
  }
  if (sum.triangles > 0 && (cube.level == depth_ || keep_whole(sum))) {
    out.resize(first);
    out.push_back(sum);
  }
  return sum;
}

std::vector<SubvolumePlan> TopTree::subvolumes_by_weight(double most_weight) const {
  std::vector<SubvolumePlan> out;
  gather(
      {}, 0, [&](const SubvolumePlan& s) { return s.weight <= most_weight; }, out);
  return out;
}

std::vector<SubvolumePlan> TopTree::subvolumes_by_edge(int64_t edge_voxels) const {
  std::vector<SubvolumePlan> out;
  gather(
      {}, 0,
      [&](const SubvolumePlan& s) { return s.cube.edge_voxels(grid_levels_) <= edge_voxels; }, out);
  return out;
}

}  // namespace voxdag
