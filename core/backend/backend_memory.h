// Divides the budget of one Backend::build() call among the structures that only make it faster.
// A structure that exceeds its part is made smaller or omitted; the result is the same. All other
// memory of a build (triangles, tile bricks, the tables as they grow) is allocated on demand, until
// the budget refuses it and the subvolume is split.
//
// Only the CPU backend has these parts. The guarantee for kSmallestBudget holds for them.
#pragma once

#include <algorithm>
#include <cstdint>

namespace voxdag {

// The budget, or the device's memory, cannot hold the subvolume. Thrown and caught within a
// backend; Backend::build() then returns BuildOutcome::kNeedsSplit.
struct OutOfBudget {};

struct BackendMemory {
  // Pages that a backend retains for its next subvolume, uncharged, while they fit next to the
  // charged memory. A budget of less than eight times kMinPageBytes can be exceeded by
  // kMinPageBytes.
  static constexpr uint64_t kMinPageBytes = uint64_t{8} << 20;
  static constexpr uint64_t kMaxPageBytes = uint64_t{128} << 20;
  static constexpr uint64_t page_bytes(uint64_t budget_bytes) {
    return std::clamp(budget_bytes / 8, kMinPageBytes, kMaxPageBytes);
  }
  // Total size of the brick and node tables that start as large as the last subvolume's.
  static constexpr uint64_t table_bytes(uint64_t free_bytes) { return free_bytes / 4; }
  // Each table of the plane memo.
  static constexpr uint64_t plane_table_bytes(uint64_t budget_bytes, uint64_t free_bytes) {
    return std::min(budget_bytes / 16, free_bytes / 8);
  }
  // The block memo.
  static constexpr uint64_t block_memo_bytes(uint64_t free_bytes) { return free_bytes / 16; }
};

}  // namespace voxdag
