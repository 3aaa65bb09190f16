// A charge to the memory budget for data whose size is not known before it is read. The charge
// grows in steps of 64 KiB, so that most small additions need no call of the budget. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {

class GrowingCharge {
 public:
  GrowingCharge() = default;
  GrowingCharge(MemoryBudget& budget, std::string what)
      : charge_(budget, 0, what), what_(std::move(what)) {}

  // Increases the charge to at least `bytes` in total. Throws Error{kOutOfMemory} if `bytes` plus
  // one step do not fit the budget.
  void grow_to(uint64_t bytes) {
    if (bytes <= charge_.bytes() || charge_.try_resize(bytes + kStepBytes)) return;
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: " + what_ + " needs over " + size_text(bytes) +
                    ", more than the memory budget has left: expected a larger budget (" +
                    option_text("memory") + ")");
  }
  // Charges `bytes` more. The total is the sum of all calls of add().
  void add(uint64_t bytes) { grow_to(added_ += bytes); }

 private:
  static constexpr uint64_t kStepBytes = 64 << 10;

  MemoryCharge charge_;
  std::string what_;
  uint64_t added_ = 0;
};

}  // namespace voxdag
