// Divides the budget of one Backend::build() call among the caches and tables that only make the
// build faster. A structure that exceeds its part is made smaller or omitted; the result is the
// same. All other memory of a build (triangles, the bricks of a tile, tables that grow) is
// allocated on demand. If the budget refuses it, the subvolume is split.
//
// Only the CPU backend has these parts. kSmallestBudget (backend.h) is enough for a build with
// these parts. In the functions, `budget_bytes` is the complete budget, and `free_bytes` the part
// of it that is still available when the structure is allocated.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/dag/consing/consing_memory.h"

namespace voxdag {

struct BackendMemory : ConsingMemory {
  // Returns the maximum bytes of each table of the plane memo, which is a cache (plane_memo.h).
  static constexpr uint64_t plane_table_bytes(uint64_t budget_bytes, uint64_t free_bytes) {
    return std::min(budget_bytes / 16, free_bytes / 8);
  }
  // Returns the maximum bytes of the block memo, which is a cache (block_memo.h).
  static constexpr uint64_t block_memo_bytes(uint64_t free_bytes) { return free_bytes / 16; }
};

}  // namespace voxdag
