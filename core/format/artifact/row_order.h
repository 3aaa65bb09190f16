// Checks the invariants of consecutive rows of a level, before a write and after a read.
#pragma once

#include <cstdint>
#include <span>

#include "core/dag/level_array.h"

namespace voxdag {

// The row before the checked rows. `present` is false at the start of a level.
struct LastRow {
  bool present = false;
  uint64_t hash = 0;
  uint64_t mask = 0;  // child mask of a node, or voxel mask of a brick
  uint32_t children[8] = {};
};

// Checks bricks: masks not 0, strictly increasing by (hash, mask), where hashes[i] belongs to
// masks[i]. Returns an error message, or nullptr if there is no error. Sets `last` to the last row.
const char* check_brick_order(std::span<const uint64_t> hashes, std::span<const uint64_t> masks,
                              LastRow& last);
// Checks nodes: masks not 0, as many children as the masks have bits, each below `child_rows`,
// hashes truncated to `hash_bits`, strictly increasing in the total order. Returns an error
// message, or nullptr if there is no error. Sets `last` to the last row.
const char* check_node_order(const NodeLevelView& rows, uint64_t child_rows, uint32_t hash_bits,
                             LastRow& last);

}  // namespace voxdag
