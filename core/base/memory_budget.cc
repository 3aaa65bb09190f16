#include "core/base/memory_budget.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {

uint64_t MemoryBudget::available() const {
  const uint64_t used = this->used();
  const uint64_t own = used < limit_ ? limit_ - used : 0;
  return parent_ ? std::min(own, parent_->available()) : own;
}

bool MemoryBudget::try_charge(uint64_t bytes) {
  uint64_t used = used_.load(std::memory_order_relaxed);
  do {
    if (bytes > limit_ || used > limit_ - bytes) return false;
  } while (!used_.compare_exchange_weak(used, used + bytes, std::memory_order_relaxed));
  if (parent_ && !parent_->try_charge(bytes)) {
    used_.fetch_sub(bytes, std::memory_order_relaxed);
    return false;
  }
  uint64_t peak = peak_.load(std::memory_order_relaxed);
  while (peak < used + bytes &&
         !peak_.compare_exchange_weak(peak, used + bytes, std::memory_order_relaxed)) {
  }
  return true;
}

void MemoryBudget::charge(uint64_t bytes, std::string_view what) {
  if (try_charge(bytes)) return;
  throw Error(ErrorCode::kOutOfMemory,
              "out of memory: " + std::string(what) + " needs " + size_text(bytes) + ", but only " +
                  size_text(available()) + " of the budget of " + size_text(limit_) +
                  " are free: expected a larger memory budget (" + option_text("memory") + ")");
}

void MemoryBudget::release(uint64_t bytes) {
  used_.fetch_sub(bytes, std::memory_order_relaxed);
  if (parent_) parent_->release(bytes);
}

bool MemoryCharge::try_resize(uint64_t bytes) {
  if (!budget_) return bytes == 0;
  if (bytes > bytes_ && !budget_->try_charge(bytes - bytes_)) return false;
  if (bytes < bytes_) budget_->release(bytes_ - bytes);
  bytes_ = bytes;
  return true;
}

}  // namespace voxdag
