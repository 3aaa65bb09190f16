// DAGs in memory for tests of query/: of a set of voxels, or of a wall in a grid of any size.
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/render/camera.h"

// The octree of a set of voxels, without shared nodes.
class VoxelScene {
 public:
  using Voxel = std::array<int64_t, 3>;

  VoxelScene(uint32_t grid_levels, const std::set<Voxel>& voxels)
      : grid_levels_(grid_levels), words_(grid_levels - 1) {
    if (!voxels.empty()) add(0, {voxels.begin(), voxels.end()});
  }

  // Returns the DAG of all voxels with x == `plane`. It has one node per level; all four children
  // of a node are the same node.
  static VoxelScene wall(uint32_t grid_levels, int64_t plane) {
    VoxelScene scene(grid_levels, {});
    for (uint32_t level = 0; level + 2 < grid_levels; ++level) {
      const bool upper = plane >> (grid_levels - 1 - level) & 1;
      scene.words_[level] = {upper ? 0xf0u : 0x0fu, 0, 0, 0, 0};
    }
    uint64_t mask = 0;
    for (int y = 0; y < 4; ++y)
      for (int z = 0; z < 4; ++z)
        mask |= uint64_t{1} << voxdag_reader::File::brick_bit(plane & 3, y, z);
    scene.words_.back() = {static_cast<uint32_t>(mask), static_cast<uint32_t>(mask >> 32)};
    return scene;
  }

  // Returns a block: the voxels from 6 to 9 along each axis, in a grid of 16^3 voxels.
  static VoxelScene block() {
    std::set<Voxel> voxels;
    for (int64_t x = 6; x < 10; ++x)
      for (int64_t y = 6; y < 10; ++y)
        for (int64_t z = 6; z < 10; ++z) voxels.insert({x, y, z});
    return VoxelScene(4, voxels);
  }

  std::vector<uint32_t>& level_words(uint32_t level) { return words_[level]; }
  voxdag::query::DagView view() const {
    std::vector<voxdag::query::DagView::Level> levels;
    if (!words_.back().empty())
      for (const std::vector<uint32_t>& words : words_) levels.push_back({words});
    return voxdag::query::DagView(std::move(levels), grid_levels_, "scene");
  }

 private:
  // Adds a node or brick for `voxels`, the voxels in its cube, and returns its word offset.
  uint32_t add(uint32_t level, const std::vector<Voxel>& voxels) {
    if (level + 2 == grid_levels_) return add_brick(voxels);
    const uint32_t shift = grid_levels_ - 1 - level;
    std::array<std::vector<Voxel>, 8> parts;
    for (const Voxel& v : voxels)
      parts[static_cast<size_t>((v[0] >> shift & 1) << 2 | (v[1] >> shift & 1) << 1 |
                                (v[2] >> shift & 1))]
          .push_back(v);
    std::vector<uint32_t> words = {0};
    for (size_t i = 0; i < 8; ++i) {
      if (parts[i].empty()) continue;
      words[0] |= 1u << i;
      words.push_back(add(level + 1, parts[i]));
    }
    const auto offset = static_cast<uint32_t>(words_[level].size());
    words_[level].insert(words_[level].end(), words.begin(), words.end());
    return offset;
  }

  uint32_t add_brick(const std::vector<Voxel>& voxels) {
    uint64_t mask = 0;
    for (const Voxel& v : voxels)
      mask |= uint64_t{1} << voxdag_reader::File::brick_bit(v[0], v[1], v[2]);
    auto& bricks = words_.back();
    bricks.push_back(static_cast<uint32_t>(mask));
    bricks.push_back(static_cast<uint32_t>(mask >> 32));
    return static_cast<uint32_t>(bricks.size() - 2);
  }

  uint32_t grid_levels_;
  std::vector<std::vector<uint32_t>> words_;
};

// A camera that looks at VoxelScene::block().
inline const voxdag::query::Placement kFromTheFront{{{8, 9, 24}}, {{8, 8, 8}}, 40};
