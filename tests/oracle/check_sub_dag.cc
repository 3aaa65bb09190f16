#include "tests/oracle/check_sub_dag.h"

#include <string>

#include "core/base/error.h"
#include "core/dag/node_hash.h"

namespace voxdag {
namespace {

[[noreturn]] void broken(uint32_t level, uint64_t node, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "sub-DAG level " + std::to_string(level) + ", node " +
                                       std::to_string(node) + ": " + what);
}

void check_all_used(const std::vector<bool>& used, uint32_t level) {
  for (size_t i = 0; i < used.size(); ++i)
    if (!used[i]) broken(level, i, "no parent refers to it");
}

}  // namespace

void check_sub_dag(const SubDag& dag, const SubDagShape& shape) {
  const uint32_t brick_level = shape.brick_level(), hash_bits = shape.hash_bits;
  if (dag.levels.size() != brick_level - shape.cube_level)
    throw Error(ErrorCode::kCorrupt, "sub-DAG has " + std::to_string(dag.levels.size()) +
                                         " node levels, expected " +
                                         std::to_string(brick_level - shape.cube_level));
  std::vector<uint64_t> child_hashes(dag.brick_masks.size());
  for (size_t i = 0; i < dag.brick_masks.size(); ++i) {
    const uint64_t mask = dag.brick_masks[i];
    if (mask == 0) broken(brick_level, i, "the brick is empty");
    child_hashes[i] = truncate_hash(hash_brick(mask), hash_bits);
    if (i > 0 && (child_hashes[i - 1] > child_hashes[i] ||
                  (child_hashes[i - 1] == child_hashes[i] && dag.brick_masks[i - 1] >= mask)))
      broken(brick_level, i, "bricks are not in the order of hash and mask");
  }
  for (const SubDag::Nodes& nodes : dag.levels) {
    const uint32_t level = brick_level - 1 - static_cast<uint32_t>(&nodes - dag.levels.data());
    if (nodes.level != level || nodes.masks.size() != nodes.hashes.size())
      broken(level, 0, "the level array is labeled or sized wrongly");
    std::vector<bool> used(child_hashes.size(), false);
    size_t at = 0, previous_at = 0;
    for (size_t i = 0; i < nodes.masks.size(); ++i) {
      const int count = popcount64(nodes.masks[i]);
      if (count == 0) broken(level, i, "the child mask is empty");
      if (at + count > nodes.children.size()) broken(level, i, "children are missing");
      uint64_t hashes[8];
      for (int c = 0; c < count; ++c) {
        const uint32_t child = nodes.children[at + c];
        if (child >= child_hashes.size()) broken(level, i, "a child index is out of range");
        used[child] = true;
        hashes[c] = child_hashes[child];
      }
      if (truncate_hash(hash_node(nodes.masks[i], hashes), hash_bits) != nodes.hashes[i])
        broken(level, i, "the hash is not that of its mask and children");
      if (i > 0 &&
          compare_nodes(nodes.hashes[i - 1], nodes.masks[i - 1], &nodes.children[previous_at],
                        nodes.hashes[i], nodes.masks[i], &nodes.children[at]) >= 0)
        broken(level, i, "nodes are not in the total order");
      previous_at = at;
      at += count;
    }
    if (at != nodes.children.size()) broken(level, nodes.masks.size(), "children are left over");
    check_all_used(used, level + 1);
    child_hashes = nodes.hashes;
  }
  if (child_hashes.size() != 1)
    broken(shape.cube_level, 0, "expected one root, found " + std::to_string(child_hashes.size()));
}

}  // namespace voxdag
