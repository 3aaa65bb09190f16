#include "scheduler/stages/ingest/top_tree.h"

#include <algorithm>
#include <cmath>

#include "core/backend/backend.h"
#include "core/dag/brick.h"
#include "core/geometry/morton.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {
namespace {

// The smallest edge of a cell in voxels. Finer cells cost more time than they save by a better
// plan.
constexpr int64_t kMinCellEdge = 2 * kSmallestEdge;

}  // namespace

ExpectedWork expected_work(const SnappedTriangle& t) {
  constexpr double kVoxel = 1.0 / kUnitsPerVoxel, kBrick = 1.0 / kBrickEdge;
  double e[2][3], extents = 0;  // two edges, and the sum of the extents, in voxels
  for (int a = 0; a < 3; ++a) {
    e[0][a] = (t.v[1][a] - t.v[0][a]) * kVoxel;
    e[1][a] = (t.v[2][a] - t.v[0][a]) * kVoxel;
    const double low = std::min(std::min(t.v[0][a], t.v[1][a]), t.v[2][a]);
    const double high = std::max(std::max(t.v[0][a], t.v[1][a]), t.v[2][a]);
    extents += (high - low) * kVoxel;
  }
  // Sum of the areas of the triangle's projections along the three axes, in square voxels. It is
  // the triangle's area times |nx| + |ny| + |nz|, where n is the unit normal.
  double area = 0;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    area += 0.5 * std::abs(e[0][b] * e[1][c] - e[0][c] * e[1][b]);
  }
  return {area + extents + 1, area * kBrick * kBrick + extents * kBrick + 1};
}

uint32_t TopTree::depth_within(uint32_t grid_levels, uint64_t bytes) {
  uint32_t depth = 0;
  while (depth < kMaxDepth && (int64_t{1} << (grid_levels - depth)) > kMinCellEdge &&
         (sizeof(Cell) << (3 * (depth + 1))) <= bytes)
    ++depth;
  return depth;
}

TopTree::TopTree(uint32_t grid_levels, MemoryBudget& budget, uint32_t depth)
    : grid_levels_(grid_levels),
      depth_(depth),
      cells_(budget, size_t{1} << (3 * depth), "the top tree's counters") {}

void TopTree::Tally::clear() {
  entries_.clear();
  large_.clear();
  last_entry_.fill(0);
  last_cell_ = {};
}

// Adds the triangle to the entries of the cells that it touches. Consecutive triangles of a scene
// usually touch the same few cells. last_entry_ finds the entries of these cells, so that few
// triangles need new entries.
void TopTree::Tally::add(const FixedTriangle& triangle, double weight) {
  if (last_cell_.contains(triangle)) {
    entries_[entry_of_last_cell_].weight += static_cast<float>(weight);
    ++entries_[entry_of_last_cell_].triangles;
    return;
  }
  find_touched(triangle);
  if (touched_.size() > kMaxTouched) return large_.push_back({triangle, weight});
  for (const uint64_t code : touched_) {
    uint32_t& last = last_entry_[code % kSlots];
    if (last >= entries_.size() || entries_[last].code != code) {
      last = static_cast<uint32_t>(entries_.size());
      entries_.push_back({.code = code});
    }
    entries_[last].weight += static_cast<float>(weight / static_cast<double>(touched_.size()));
    ++entries_[last].triangles;
  }
  if (touched_.size() == 1) remember_cell(triangle);
}

// Called for a triangle that touches one cell. Makes this cell last_cell_ if the triangle is inside
// the cell, which is true unless the triangle extends beyond the grid.
void TopTree::Tally::remember_cell(const FixedTriangle& triangle) {
  const CellBox box(triangle, grid_levels_, depth_);
  Cube cell{depth_, {}};
  for (int a = 0; a < 3; ++a) {
    if (box.low[a] != box.high[a]) return;
    cell.position[a] = static_cast<uint32_t>(box.low[a]);
  }
  last_cell_ = CubeInside(cell, grid_levels_);
  entry_of_last_cell_ = last_entry_[touched_[0] % kSlots];
}

void TopTree::add(Tally& tally) {
  const auto add_to_cell = [this](uint64_t code, float weight, uint32_t triangles) {
    Cell& cell = cells_[code];
    cell.weight += weight;
    cell.triangles += std::min(triangles, UINT32_MAX - cell.triangles);
    total_weight_ += static_cast<double>(weight);
  };
  for (const Tally::Entry& entry : tally.entries_)
    add_to_cell(entry.code, entry.weight, entry.triangles);
  for (const Tally::LargeTriangle& large : tally.large_) {
    tally.find_touched(large.triangle);
    const double cells = static_cast<double>(tally.touched_.size());
    for (const uint64_t code : tally.touched_)
      add_to_cell(code, static_cast<float>(large.weight / cells), 1);
  }
}

void TopTree::Tally::find_touched(const FixedTriangle& triangle) {
  touched_.clear();
  const CellBox box(triangle, grid_levels_, depth_);
  if (!box.is_inside_grid()) return collect(triangle, Cube{}, 0);
  int64_t cells = 1;
  for (int a = 0; a < 3; ++a) cells *= box.high[a] - box.low[a] + 1;
  if (cells > 8) {
    const Cube cube = box.cube_around();
    return collect(triangle, cube,
                   morton_encode(cube.position[0], cube.position[1], cube.position[2]));
  }
  // A triangle whose bounding box is in one cell touches this cell. A triangle whose box is in two
  // cells touches both, because it crosses their common face. Larger boxes need a test per cell.
  const int64_t units = (kUnitsPerVoxel << grid_levels_) >> depth_;
  for (int64_t x = box.low[0]; x <= box.high[0]; ++x)
    for (int64_t y = box.low[1]; y <= box.high[1]; ++y)
      for (int64_t z = box.low[2]; z <= box.high[2]; ++z) {
        const int64_t corner[3] = {x * units, y * units, z * units};
        if (cells <= 2 || triangle_touches_cube(triangle, corner, units))
          touched_.push_back(morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                                           static_cast<uint32_t>(z)));
      }
}

void TopTree::Tally::collect(const FixedTriangle& triangle, const Cube& cube, uint64_t code) {
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

bool TopTree::is_empty(uint64_t code) const {
  constexpr uint64_t kCells = uint64_t{1} << 3 * kSkippedLevels;
  uint64_t any = 0;
  for (uint64_t i = code * kCells; i < (code + 1) * kCells; ++i) any |= cells_[i].triangles;
  return any == 0;
}

// Appends the subvolumes of a cube to `out`, bottom-up: a cube for which is_small_enough() is true
// replaces its parts. Returns the cube with its total weight and triangles.
template <class IsSmallEnough>
SubvolumePlan TopTree::gather(const Cube& cube, uint64_t code, const IsSmallEnough& is_small_enough,
                              std::vector<SubvolumePlan>& out) const {
  SubvolumePlan whole;
  whole.cube = cube;
  if (cube.level + kSkippedLevels == depth_ && is_empty(code)) return whole;
  const size_t first = out.size();
  if (cube.level == depth_) {
    whole.weight = cells_[code].weight;
    whole.triangles = cells_[code].triangles;
  } else {
    for (int c = 0; c < 8; ++c) {
      const SubvolumePlan part =
          gather(cube.child(c), code * 8 + static_cast<uint64_t>(c), is_small_enough, out);
      whole.weight += part.weight;
      whole.triangles += part.triangles;
    }
  }
  if (whole.triangles > 0 && (cube.level == depth_ || is_small_enough(whole))) {
    out.resize(first);
    out.push_back(whole);
  }
  return whole;
}

std::vector<SubvolumePlan> TopTree::subvolumes_by_weight(const SubvolumeLimits& limits) const {
  std::vector<SubvolumePlan> out;
  gather(
      {}, 0,
      [&](const SubvolumePlan& s) { return limits.allow(s, s.cube.edge_voxels(grid_levels_)); },
      out);
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
