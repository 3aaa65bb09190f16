// Synthetic artifacts for the benchmarks of the merge. Each is a run: random bricks and nodes,
// sorted by (hash, mask, children). Runs have some nodes in common, like neighboring subvolumes.
#pragma once

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "core/dag/node_hash.h"
#include "core/format/artifact/artifact_writer.h"

namespace voxdag {

// A run consists of blocks; a block is a small DAG. Two runs that contain the same block share its
// nodes. The children of a node are random nodes of its block. In real runs, the children of a node
// are also far apart, because runs are sorted by hash.
class SyntheticRuns {
 public:
  static constexpr uint32_t kLevels = 5;  // levels of nodes above the bricks
  static constexpr uint32_t kGridLevels = 14;

  // Writes `runs` artifacts with about `rows` rows (bricks and nodes) in total to one segment. Half
  // of each run's blocks come from a common pool. Each block of the pool is drawn about four times.
  SyntheticRuns(const std::string& folder, size_t runs, uint64_t rows) {
    segment_path_ = segment_path(folder, 0);
    SegmentWriter segment(system_files(), folder, 0, budget_);
    const size_t blocks_each = std::max<size_t>(2, rows / runs / kBlockRows);
    const size_t pool = runs * blocks_each / 8 + 1;
    for (size_t run = 0; run < runs; ++run) {
      Levels levels(kLevels + 1);
      for (size_t block = 0; block < blocks_each; ++block) {
        const bool common = block % 2 == 0;
        add_block(levels, common ? random_() % pool : pool + run * blocks_each + block);
      }
      write(segment, levels, run);
    }
    segment.flush();
  }

  const std::vector<ArtifactRef>& refs() const { return refs_; }
  std::shared_ptr<ReadableFile> open() const { return system_files().open_read(segment_path_); }

 private:
  static constexpr size_t kBlockRows = 252;

  struct Row {
    uint64_t hash = 0;
    uint64_t brick = 0;
    uint8_t mask = 0;
    std::vector<uint32_t> children;  // indices of rows in the level below
  };
  using Levels = std::vector<std::vector<Row>>;

  static void add_block(Levels& levels, uint64_t seed) {
    std::mt19937_64 random(seed);
    size_t count = 128;  // 128 bricks, then 64, 32, ... nodes with 3.2 children on average
    size_t first_below = 0;
    for (size_t l = 0; l < levels.size(); ++l, count /= 2) {
      const size_t first = levels[l].size(), below = 2 * count;
      for (size_t i = 0; i < count; ++i) {
        Row row;
        if (l == 0) {
          row.brick = random() | 1;
          row.hash = hash_brick(row.brick);
        } else {
          row.mask = random_mask(random);
          uint64_t hashes[8];
          for (int c = 0; c < popcount64(row.mask); ++c) {
            row.children.push_back(static_cast<uint32_t>(first_below + random() % below));
            hashes[c] = levels[l - 1][row.children.back()].hash;
          }
          row.hash = hash_node(row.mask, hashes);
        }
        levels[l].push_back(std::move(row));
      }
      first_below = first;
    }
  }

  static uint8_t random_mask(std::mt19937_64& random) {
    const uint8_t mask = static_cast<uint8_t>(random() & (random() | random()));
    return mask ? mask : 255;
  }

  void write(SegmentWriter& segment, const Levels& levels, size_t run) {
    ArtifactWriter writer(segment, {.grid_levels = kGridLevels});
    std::vector<uint32_t> index_below, index;
    for (size_t l = 0; l < levels.size(); ++l) {
      std::vector<uint32_t> order(levels[l].size());
      for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<uint32_t>(i);
      std::ranges::sort(order, {}, [&](uint32_t i) { return levels[l][i].hash; });
      const uint32_t level = kGridLevels - 2 - static_cast<uint32_t>(l);
      std::vector<uint64_t> bricks, hashes;
      std::vector<uint8_t> masks;
      std::vector<uint32_t> children;
      index.assign(order.size(), 0);
      uint32_t next = 0;
      for (size_t i = 0; i < order.size(); ++i) {
        const Row& row = levels[l][order[i]];
        const bool again = i > 0 && levels[l][order[i - 1]].hash == row.hash;
        index[order[i]] = again ? next - 1 : next++;
        if (again) continue;
        bricks.push_back(row.brick);
        hashes.push_back(row.hash);
        masks.push_back(row.mask);
        for (const uint32_t child : row.children) children.push_back(index_below[child]);
      }
      writer.begin_level(level);
      if (l == 0)
        writer.append_bricks(bricks);
      else
        writer.append_nodes({level, hashes, masks, children});
      writer.end_level();
      index_below = index;
    }
    // Each run has one root. Different runs have roots in different cubes.
    const uint32_t top = kGridLevels - 2 - kLevels;
    const uint32_t x = static_cast<uint32_t>(run);
    const ArtifactRoot root{{top, {x >> 8, x >> 4 & 15, x & 15}}, 0, 1, 1, 1};
    refs_.push_back(writer.finish({&root, 1}));
  }

  MemoryBudget budget_{uint64_t{1} << 30};
  std::mt19937_64 random_{1};
  std::string segment_path_;
  std::vector<ArtifactRef> refs_;
};

}  // namespace voxdag
