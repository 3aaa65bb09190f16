// Limits for memory that only makes hash-consing faster. Hash-consing finds equal nodes by their
// hashes while a sub-DAG is built. If such memory would exceed its limit, the build uses less of it
// or none. The resulting DAG is the same.
#pragma once

#include <algorithm>
#include <cstdint>

namespace voxdag {

struct ConsingMemory {
  // Maximum size of the free pages that are retained for the next sub-DAG. Retained pages are not
  // charged to the budget. If the budget cannot hold the retained pages and a new allocation
  // together, the retained pages are freed first. A budget of less than eight times kMinPageBytes
  // can be exceeded by kMinPageBytes; the division of the memory among workers allows for this
  // (scheduler/spec/memory_plan.h).
  static constexpr uint64_t kMinPageBytes = uint64_t{8} << 20;
  static constexpr uint64_t kMaxPageBytes = uint64_t{512} << 20;
  static constexpr uint64_t page_bytes(uint64_t budget_bytes) {
    return std::clamp(budget_bytes / 8, kMinPageBytes, kMaxPageBytes);
  }
  // Maximum total size of the brick and node tables that a build reserves in advance. Each table is
  // reserved at the size that it had for the last sub-DAG.
  static constexpr uint64_t table_bytes(uint64_t free_bytes) { return free_bytes / 4; }
};

}  // namespace voxdag
