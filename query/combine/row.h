// A node or a brick while levels are combined. Rows are compared in the total order of
// docs/format.md.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/base/popcount8.h"
#include "core/dag/node_hash.h"

namespace voxdag::query {

struct Row {
  uint64_t hash = 0;          // truncated
  uint32_t mask = 0;          // child mask; 0 for a brick
  uint32_t count = 0;         // number of children; 1 for a brick
  uint64_t children[8] = {};  // word offsets in one numbering; for a brick, the mask of its voxels
};

// Returns a number < 0, 0 (equal) or > 0.
inline int compare_rows(const Row& a, const Row& b) {
  if (a.hash != b.hash) return a.hash < b.hash ? -1 : 1;
  if (a.mask != b.mask) return a.mask < b.mask ? -1 : 1;
  for (uint32_t i = 0; i < a.count; ++i)
    if (a.children[i] != b.children[i]) return a.children[i] < b.children[i] ? -1 : 1;
  return 0;
}

inline Row brick_row(uint64_t mask, uint32_t hash_bits) {
  Row row;
  row.hash = truncate_hash(hash_brick(mask), hash_bits);
  row.count = 1;
  row.children[0] = mask;
  return row;
}

}  // namespace voxdag::query
