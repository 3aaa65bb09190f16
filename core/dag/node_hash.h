// Hashes of bricks and nodes. A hash depends on the subtree alone, not on level, position or index.
// Hashes only find candidates for equal nodes; masks and children always decide. docs/format.md,
// "Node hash", is the specification. A changed constant requires a new format version.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/base/integers.h"

namespace voxdag {

// Returns the hash of a brick. The hash is a bijection of 64-bit words (two rounds of xor-shift and
// odd multiplication), so two bricks have the same full hash only if they are the same brick.
VOXDAG_HD inline uint64_t hash_brick(uint64_t mask) {
  uint64_t h = mask ^ 0x9e3779b97f4a7c15ull;
  h = (h ^ h >> 32) * 0xd6e8feb86659fd93ull;
  h = (h ^ h >> 29) * 0xa0761d6478bd642full;
  return h ^ h >> 32;
}

// The next three functions compute the hash of a node. Call node_hash_begin() with the child mask,
// node_hash_add() for the hash of each child in child order, then node_hash_end(). Each call takes
// the result of the previous call as `state`.
VOXDAG_HD inline uint64_t node_hash_begin(uint32_t child_mask) {
  return child_mask * 0x9e3779b97f4a7c15ull ^ 0xe7037ed1a0b428dbull;
}
VOXDAG_HD inline uint64_t node_hash_add(uint64_t state, uint64_t child_hash) {
  return fold_multiply(state ^ child_hash, 0x8ebc6af09c88c6e3ull) + 0x589965cc75374cc3ull;
}
VOXDAG_HD inline uint64_t node_hash_end(uint64_t state) {
  return fold_multiply(state, 0x1d8e4e27c47d124full);
}

// Returns the hash of a node. `child_hashes` has the hashes of the `count` children in
// `child_mask`, in child order.
VOXDAG_HD inline uint64_t hash_node(uint32_t child_mask, int count, const uint64_t* child_hashes) {
  uint64_t h = node_hash_begin(child_mask);
  for (int i = 0; i < count; ++i) h = node_hash_add(h, child_hashes[i]);
  return node_hash_end(h);
}
VOXDAG_HD inline uint64_t hash_node(uint32_t child_mask, const uint64_t* child_hashes) {
  return hash_node(child_mask, popcount64(child_mask), child_hashes);
}

// Implements --hash-bits: keeps the top `bits` bits (4 to 64) of the hash and sets all lower bits
// to 0. Parents are hashed from the truncated hashes of their children.
VOXDAG_HD inline uint64_t truncate_hash(uint64_t hash, uint32_t bits) {
  return bits >= 64 ? hash : hash & ~(~uint64_t{0} >> bits);
}

}  // namespace voxdag
