// The invariants of consecutive rows of a level array, checked before a write and after a read.
#pragma once

#include <cstdint>

#include "core/format/artifact/artifact.h"

namespace voxdag {

// The row before those to be checked; none at the start of a level.
struct LastRow {
  bool present = false;
  uint64_t hash = 0;
  uint64_t mask = 0;  // of the node, or the brick
  uint32_t children[8] = {};
};

// All return nullptr, or what is wrong; `last` becomes the last row. Bricks: masks not 0, strictly
// increasing by (hash, mask), where hashes[i] belongs to masks[i].
const char* check_brick_order(std::span<const uint64_t> hashes, std::span<const uint64_t> masks,
                              LastRow& last);
// Nodes: as many children as the masks say, each below `child_rows`; masks not 0; hashes cut to
// `hash_bits`; strictly increasing in the total order.
const char* check_node_order(const NodeLevelView& rows, uint64_t child_rows, uint32_t hash_bits,
                             LastRow& last);

}  // namespace voxdag
