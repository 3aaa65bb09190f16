// Artifacts for tests: functions that write and read complete level arrays in the total order.
#pragma once

#include <algorithm>
#include <memory>
#include <string>

#include "core/dag/node_hash.h"
#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/artifact_writer.h"
#include "tests/oracle/scenes.h"

namespace voxdag {

// Returns random rows that obey the rules of an artifact: `count` bricks, and `count` nodes on each
// of `node_levels` levels. Some rows have no parent, as in the artifacts of a merge pass, which
// have many roots.
inline SubDag random_rows(uint64_t seed, size_t count, uint32_t grid_levels, uint32_t node_levels,
                          uint32_t hash_bits) {
  oracle::Random random(seed);
  SubDag dag;
  std::vector<std::pair<uint64_t, uint64_t>> bricks;
  while (bricks.size() < count) {
    const uint64_t mask = static_cast<uint64_t>(random.between(1, INT64_MAX / 2));
    bricks.emplace_back(truncate_hash(hash_brick(mask), hash_bits), mask);
  }
  std::sort(bricks.begin(), bricks.end());
  bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
  for (const auto& [hash, mask] : bricks) dag.brick_masks.push_back(mask);

  struct Row {
    uint64_t hash;
    uint8_t mask;
    std::vector<uint32_t> children;
    auto operator<=>(const Row&) const = default;
  };
  size_t below = dag.brick_masks.size();
  for (uint32_t i = 0; i < node_levels; ++i) {
    std::vector<Row> rows;
    while (rows.size() < count) {
      Row row{truncate_hash(hash_brick(rows.size() + 77 * seed), hash_bits),
              static_cast<uint8_t>(random.between(1, 255)),
              {}};
      for (int c = popcount64(row.mask); c > 0; --c)
        row.children.push_back(
            static_cast<uint32_t>(random.between(0, static_cast<int64_t>(below) - 1)));
      rows.push_back(row);
    }
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    SubDag::Nodes& nodes = dag.levels.emplace_back();
    nodes.level = grid_levels - 3 - i;
    for (const Row& row : rows) {
      nodes.hashes.push_back(row.hash);
      nodes.masks.push_back(row.mask);
      nodes.children.insert(nodes.children.end(), row.children.begin(), row.children.end());
    }
    below = rows.size();
  }
  return dag;
}

inline ArtifactRef write_artifact(SegmentWriter& segment, const SubDag& dag, uint32_t grid_levels,
                                  uint32_t hash_bits, std::span<const ArtifactRoot> roots = {}) {
  ArtifactWriter writer(segment, {.grid_levels = grid_levels, .hash_bits = hash_bits});
  writer.bricks({dag.brick_masks});
  for (const SubDag::Nodes& nodes : dag.levels) writer.nodes(nodes.view());
  const ArtifactRef ref = writer.finish(roots);
  segment.flush();
  return ref;
}

inline SubDag read_artifact(const ArtifactReader& reader) {
  SubDag dag;
  Frame frame;
  for (const ArtifactLevel& level : reader.levels()) {
    const bool bricks = level.level == reader.shape().brick_level();
    if (!bricks) dag.levels.emplace_back().level = level.level;
    for (size_t i = 0; i < level.frames.size(); ++i) {
      reader.read_frame(level.level, i, frame);
      const auto append = [](auto& to, const auto& from) {
        to.insert(to.end(), from.begin(), from.end());
      };
      if (bricks) {
        append(dag.brick_masks, frame.brick_masks);
      } else {
        append(dag.levels.back().hashes, frame.hashes);
        append(dag.levels.back().masks, frame.masks);
        append(dag.levels.back().children, frame.children);
      }
    }
  }
  return dag;
}

}  // namespace voxdag
