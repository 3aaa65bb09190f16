// The parts of a budget that only make hash-consing faster. A part that would exceed its limit is
// made smaller or omitted; the result is the same.
#pragma once

#include <algorithm>
#include <cstdint>

namespace voxdag {

struct ConsingMemory {
  // Retained pages for the next sub-DAG. They are not charged, and are kept only while they fit
  // next to the charged memory. A budget of less than eight times kMinPageBytes can be exceeded by
  // kMinPageBytes.
  static constexpr uint64_t kMinPageBytes = uint64_t{8} << 20;
  static constexpr uint64_t kMaxPageBytes = uint64_t{128} << 20;
  static constexpr uint64_t page_bytes(uint64_t budget_bytes) {
    return std::clamp(budget_bytes / 8, kMinPageBytes, kMaxPageBytes);
  }
  // Total size of the brick and node tables that are reserved at the sizes of the last sub-DAG.
  static constexpr uint64_t table_bytes(uint64_t free_bytes) { return free_bytes / 4; }
};

}  // namespace voxdag
