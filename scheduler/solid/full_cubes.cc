#include "scheduler/solid/full_cubes.h"

#include <algorithm>
#include <array>
#include <vector>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/node_hash.h"
#include "core/format/artifact/artifact_writer.h"

namespace voxdag {
namespace {

constexpr uint32_t kAllChildren = 0xff;

// Returns the hashes of the full nodes of all levels, the bricks' level last.
std::vector<uint64_t> full_hashes(const DagShape& shape) {
  std::vector<uint64_t> hashes(shape.brick_level() + 1);
  hashes.back() = truncate_hash(hash_brick(~uint64_t{0}), shape.hash_bits);
  for (uint32_t level = shape.brick_level(); level-- > 0;) {
    std::array<uint64_t, 8> children;
    children.fill(hashes[level + 1]);
    hashes[level] = truncate_hash(hash_node(kAllChildren, children.data()), shape.hash_bits);
  }
  return hashes;
}

int size_log2_of(const Cube& cube, const DagShape& shape) {
  return static_cast<int>(shape.grid_levels - cube.level);
}

}  // namespace

ArtifactRef add_full_cubes(SegmentWriter& segment, const DagShape& shape,
                           std::span<const Cube> cubes) {
  const std::vector<uint64_t> hashes = full_hashes(shape);
  uint32_t top = shape.brick_level();
  for (const Cube& cube : cubes) top = std::min(top, cube.level);
  ArtifactWriter writer(segment, shape);
  const uint64_t brick = ~uint64_t{0};
  writer.bricks({{&brick, 1}});
  const uint8_t mask = kAllChildren;
  const std::array<uint32_t, 8> children{};
  for (uint32_t level = shape.brick_level(); level-- > top;)
    writer.nodes({level, {&hashes[level], 1}, {&mask, 1}, children});
  std::vector<ArtifactRoot> roots;
  for (const Cube& cube : cubes) {
    const OctreeCounts counts = full_counts(size_log2_of(cube, shape));
    roots.push_back({cube, 0, hashes[cube.level], counts.voxels, counts.nodes});
  }
  return writer.finish(roots);
}

SubDagSummary full_summary(const Cube& cube, const DagShape& shape, bool is_disputed) {
  const OctreeCounts counts = full_counts(size_log2_of(cube, shape));
  SubDagSummary summary;
  summary.voxels = summary.interior = counts.voxels;
  summary.svo_nodes = counts.nodes;
  summary.dag_nodes = shape.brick_level() - cube.level + 1;
  summary.root_hash = full_hashes(shape)[cube.level];
  summary.disputed = is_disputed ? counts.voxels : 0;
  return summary;
}

}  // namespace voxdag
