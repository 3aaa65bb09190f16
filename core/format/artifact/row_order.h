// Checks the invariants of consecutive rows of a level, before a frame is written and after it is
// read.
#pragma once

#include <cstdint>
#include <span>

#include "core/dag/level_array.h"

namespace voxdag {

// The row before the rows to check. `present` is false at the start of a level.
struct LastRow {
  bool present = false;
  uint64_t hash = 0;
  uint64_t mask = 0;  // child mask of a node, or voxel mask of a brick
  uint32_t children[8] = {};
};

// Checks bricks: masks are not 0, and bricks strictly increase by (hash, mask). hashes[i] is the
// truncated hash of masks[i]. Returns an error message, or nullptr if there is no error. Sets
// `last` to the last row.
const char* check_brick_order(std::span<const uint64_t> hashes, std::span<const uint64_t> masks,
                              LastRow& last);
// Checks nodes:
//
//   - masks are not 0, and the number of children is the number of set bits in all masks;
//   - child indices are below `child_rows`, the number of rows of the level below;
//   - hashes are truncated to `hash_bits`;
//   - nodes strictly increase by (hash, mask, children).
//
// Returns an error message, or nullptr if there is no error. Sets `last` to the last row.
const char* check_node_order(const NodeLevelView& rows, uint64_t child_rows, uint32_t hash_bits,
                             LastRow& last);

}  // namespace voxdag
