// Level arrays: the nodes of one level of a sub-DAG, or of several merged sub-DAGs. The nodes are
// sorted in the total order, by
//
//     (hash, mask, child indices lexicographically)         or, for bricks, (hash, mask)
//
// Child indices are positions in the next level's array (bricks follow the last node level). Within
// a level no two nodes are equal in mask and children.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/host_device.h"

namespace voxdag {

// The bricks (level L-2): masks in the order of (truncated hash, mask). Hashes are not stored
// because hash_brick() computes them from the masks.
struct BrickLevelView {
  std::span<const uint64_t> masks;
};

// Any level above the bricks: node i has child mask masks[i] and hash hashes[i]. `children` lists
// the children of node 0, then of node 1, and so on: popcount(masks[i]) per node, in child order.
struct NodeLevelView {
  uint32_t level = 0;
  std::span<const uint64_t> hashes;
  std::span<const uint8_t> masks;
  std::span<const uint32_t> children;
};

// Compares two child lists of the same mask lexicographically. Returns a number < 0, 0 or > 0.
VOXDAG_HD inline int compare_children(const uint32_t* a, const uint32_t* b, int count) {
  for (int i = 0; i < count; ++i)
    if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
  return 0;
}

// Compares two nodes in the total order. Returns a number < 0, 0 (the same node) or > 0.
VOXDAG_HD inline int compare_nodes(uint64_t hash_a, uint32_t mask_a, const uint32_t* children_a,
                                   uint64_t hash_b, uint32_t mask_b, const uint32_t* children_b) {
  if (hash_a != hash_b) return hash_a < hash_b ? -1 : 1;
  if (mask_a != mask_b) return mask_a < mask_b ? -1 : 1;
  return compare_children(children_a, children_b, popcount64(mask_a));
}

}  // namespace voxdag
