// Test data for core/dag/space: grids of voxels, and the DAGs of these grids with labels for the
// components of their empty space.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/dag/space/enclosed_fill.h"

namespace voxdag {

using SpaceCell = std::array<int, 3>;

// The voxels of a box: 1 if the voxel is set, otherwise 0. `size` is the number of voxels along
// each axis.
struct SpaceGrid {
  explicit SpaceGrid(SpaceCell cells) : size(cells) {
    voxels.resize(static_cast<size_t>(size[0]) * size[1] * size[2]);
  }
  explicit SpaceGrid(int edge) : SpaceGrid(SpaceCell{edge, edge, edge}) {}
  size_t index(const SpaceCell& c) const {
    return (static_cast<size_t>(c[0]) * size[1] + c[1]) * size[2] + c[2];
  }
  uint8_t& at(const SpaceCell& c) { return voxels[index(c)]; }
  uint8_t at(const SpaceCell& c) const { return voxels[index(c)]; }
  bool has(const SpaceCell& c) const {
    for (int a = 0; a < 3; ++a)
      if (c[a] < 0 || c[a] >= size[a]) return false;
    return true;
  }
  bool is_border(const SpaceCell& c) const {
    for (int a = 0; a < 3; ++a)
      if (c[a] == 0 || c[a] == size[a] - 1) return true;
    return false;
  }
  template <class Visit>
  void for_each(Visit visit) const {
    for (int x = 0; x < size[0]; ++x)
      for (int y = 0; y < size[1]; ++y)
        for (int z = 0; z < size[2]; ++z) visit(SpaceCell{x, y, z});
  }

  SpaceCell size;
  std::vector<uint8_t> voxels;
};

// Sets the voxels of `out` that can be reached from `start` through empty voxels of `grid`, by
// steps across faces.
inline void flood(const SpaceGrid& grid, const SpaceCell& start, SpaceGrid& out) {
  std::vector<SpaceCell> reached;
  const auto reach = [&](const SpaceCell& c) {
    if (!grid.has(c) || grid.at(c) || out.at(c)) return;
    out.at(c) = 1;
    reached.push_back(c);
  };
  reach(start);
  while (!reached.empty()) {
    const SpaceCell c = reached.back();
    reached.pop_back();
    for (int a = 0; a < 3; ++a)
      for (const int step : {-1, 1}) {
        SpaceCell next = c;
        next[a] += step;
        reach(next);
      }
  }
}

inline SpaceGrid outside_of(const SpaceGrid& grid) {
  SpaceGrid out(grid.size);
  grid.for_each([&](const SpaceCell& c) {
    if (grid.is_border(c)) flood(grid, c, out);
  });
  return out;
}

// The nodes and bricks of a cubic grid, with the labels of their components of empty voxels.
class SpaceDag {
 public:
  explicit SpaceDag(const SpaceGrid& grid) : edge_(grid.size[0]) {
    for (int edge = edge_; edge > kBrickEdge; edge /= 2) {
      NodeLevels::Level& level = levels_.nodes.emplace_back();
      const size_t rows = static_cast<size_t>(edge_ / edge) * (edge_ / edge) * (edge_ / edge);
      level.masks = PooledArray<uint8_t>(memory_, rows);
      level.first_child = PooledArray<uint32_t>(memory_, rows);
      level.children = PooledArray<uint32_t>(memory_, 8 * rows);
      children_.push_back(0);
      known_.emplace_back();
    }
    known_.emplace_back();
    levels_.bricks = PooledArray<uint64_t>(memory_, grid.voxels.size() / 64);
    add(grid, {0, 0, 0}, edge_, 0);
    labels_ = std::make_unique<SpaceLabels>(memory_, levels_);
  }

  const NodeLevels& levels() const { return levels_; }
  const SpaceLabels& labels() const { return *labels_; }
  uint32_t components() const { return labels_->count(0, 0); }

  SpaceGrid fill(const std::vector<uint8_t>& is_outside) {
    return filled(
        [&](SubDagTables& tables) { fill_enclosed(memory_, *labels_, is_outside, tables); });
  }
  // Fills the component that contains the voxel, even if it reaches a face of the cube. Fills
  // nothing if the voxel is set. Sets `place` to the result of find_seed().
  SpaceGrid fill_seed(const SpaceCell& cell) {
    CubeVoxel voxel{};
    for (size_t a = 0; a < 3; ++a) voxel[a] = static_cast<uint32_t>(cell[a]);
    std::vector<uint8_t> is_outside(components(), 1);
    place = find_seed(*labels_, voxel);
    if (place.kind == SeedPlace::Kind::kOpen) is_outside.at(place.component) = 0;
    return filled([&](SubDagTables& tables) {
      fill_from_seed(memory_, *labels_, is_outside, voxel, tables);
    });
  }
  SeedPlace place;

  // Returns the voxels of the sub-DAG that `fill_tables` adds to empty tables.
  SpaceGrid filled(const std::function<void(SubDagTables&)>& fill_tables) {
    int size_log2 = 0;
    while (1 << size_log2 < edge_) ++size_log2;
    SubDagTables tables(memory_, size_log2);
    fill_tables(tables);
    SubDag dag;
    const auto grid_levels = static_cast<uint32_t>(size_log2);
    summary = emit_levels(tables, {0, grid_levels, 64}, dag);
    SpaceGrid out(edge_);
    if (summary.empty()) return out;
    expand(dag, static_cast<int>(dag.levels.size()), 0, {0, 0, 0}, edge_, out);
    return out;
  }
  // Returns the voxels of component `c`, which reaches a face of the cube.
  SpaceGrid component(uint32_t c) {
    std::vector<uint8_t> is_outside(components());
    is_outside[c] = 1;
    SpaceGrid out = fill(is_outside);
    for (uint8_t& voxel : out.voxels) voxel = !voxel;
    return out;
  }

  SubDagSummary summary;

 private:
  static SpaceCell octant_corner(const SpaceCell& low, int half, int o) {
    return {low[0] + half * (o >> 2), low[1] + half * (o >> 1 & 1), low[2] + half * (o & 1)};
  }

  // Adds the nodes and bricks of a cube. Returns the number of its row plus 1, or 0 if the cube is
  // empty.
  uint32_t add(const SpaceGrid& grid, const SpaceCell& low, int edge, size_t depth) {
    std::vector<uint64_t> key;
    if (edge == kBrickEdge) {
      uint64_t mask = 0;
      for (int bit = 0; bit < 64; ++bit)
        if (grid.at({low[0] + brick_coordinate(bit, 0), low[1] + brick_coordinate(bit, 1),
                     low[2] + brick_coordinate(bit, 2)}))
          mask |= uint64_t{1} << bit;
      if (mask == 0) return 0;
      const auto [found, is_new] = known_[depth].try_emplace({mask}, levels_.brick_rows + 1);
      if (is_new) levels_.bricks[levels_.brick_rows++] = mask;
      return static_cast<uint32_t>(found->second);
    }
    for (int o = 0; o < 8; ++o)
      key.push_back(add(grid, octant_corner(low, edge / 2, o), edge / 2, depth + 1));
    if (std::ranges::count(key, 0u) == 8) return 0;
    NodeLevels::Level& level = levels_.nodes[depth];
    const auto [found, is_new] = known_[depth].try_emplace(key, level.rows + 1);
    if (!is_new) return static_cast<uint32_t>(found->second);
    level.first_child[level.rows] = children_[depth];
    level.masks[level.rows] = 0;
    for (int o = 0; o < 8; ++o) {
      if (key[o] == 0) continue;
      level.masks[level.rows] = static_cast<uint8_t>(level.masks[level.rows] | 1 << o);
      level.children[children_[depth]++] = static_cast<uint32_t>(key[o] - 1);
    }
    return static_cast<uint32_t>(++level.rows);
  }

  void expand(const SubDag& dag, int above, uint32_t row, const SpaceCell& low, int edge,
              SpaceGrid& out) {
    if (above == 0) {
      for (int bit = 0; bit < 64; ++bit)
        out.at({low[0] + brick_coordinate(bit, 0), low[1] + brick_coordinate(bit, 1),
                low[2] + brick_coordinate(bit, 2)}) = dag.brick_masks[row] >> bit & 1;
      return;
    }
    const SubDag::Nodes& level = dag.levels[above - 1];
    size_t at = 0;
    for (uint32_t i = 0; i < row; ++i) at += popcount8(level.masks[i]);
    for (int o = 0; o < 8; ++o)
      if (level.masks[row] >> o & 1)
        expand(dag, above - 1, level.children[at++], octant_corner(low, edge / 2, o), edge / 2,
               out);
  }

  int edge_;
  MemoryBudget budget_{uint64_t{256} << 20};
  PagePool pool_;
  PooledMemory memory_{budget_, pool_};
  NodeLevels levels_;
  std::vector<uint32_t> children_;
  std::vector<std::map<std::vector<uint64_t>, uint64_t>> known_;
  std::unique_ptr<SpaceLabels> labels_;
};

// Random voxels, or walls with random doors. Never empty.
inline SpaceGrid random_grid(std::mt19937& engine, const SpaceCell& size, bool has_walls) {
  SpaceGrid grid(size);
  const unsigned percent = has_walls ? 97 : 20 + engine() % 60;
  const int room = 3 + static_cast<int>(engine() % 6);
  grid.for_each([&](const SpaceCell& c) {
    const bool is_wall = !has_walls || c[0] % room == 1 || c[1] % room == 1 || c[2] % room == 1;
    grid.at(c) = is_wall && engine() % 100 < percent;
  });
  grid.voxels[engine() % grid.voxels.size()] = 1;
  return grid;
}

template <class Test>
void for_random_grids(int edge, const Test& test) {
  std::mt19937 engine(static_cast<unsigned>(edge));
  for (int i = 0; i < 512 / edge; ++i) {
    SCOPED_TRACE(testing::Message() << "edge " << edge << ", grid " << i);
    test(random_grid(engine, {edge, edge, edge}, i % 2 != 0));
  }
}

}  // namespace voxdag
