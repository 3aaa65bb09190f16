// Accounts for large buffers, so that a build never exceeds its memory limit (--memory). The owner
// of a buffer charges its size here before it allocates the buffer. If the charge fails, the owner
// spills data to disk, splits the work or refuses the work.
//
// Invariants:
//   1. used() <= limit() at any time.
//   2. A budget can be a share of another budget, its parent. Every charge of the share is then
//      also charged to the parent.
//
// Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <string_view>

namespace voxdag {

// Thrown if a budget, or the memory of a GPU, is too small for a piece of work. The caller can
// catch it and split the work.
struct OutOfBudget {};

class MemoryBudget {
 public:
  explicit MemoryBudget(uint64_t limit_bytes, MemoryBudget* parent = nullptr)
      : limit_(limit_bytes), parent_(parent) {}
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;

  uint64_t limit() const { return limit_; }
  uint64_t used() const { return used_.load(std::memory_order_relaxed); }
  // Returns the largest number of bytes charged at any time so far.
  uint64_t peak() const { return peak_.load(std::memory_order_relaxed); }
  // Returns the bytes that can be charged now without exceeding this limit or a parent's limit.
  uint64_t available() const;

  // Charges `bytes`. Returns false and charges nothing if they do not fit.
  bool try_charge(uint64_t bytes);
  // Charges `bytes`. Throws Error{kOutOfMemory} if they do not fit. The message contains `what`,
  // the name of the buffer.
  void charge(uint64_t bytes, std::string_view what);
  void release(uint64_t bytes);

 private:
  const uint64_t limit_;
  MemoryBudget* const parent_;
  std::atomic<uint64_t> used_{0};
  std::atomic<uint64_t> peak_{0};
};

// Charges bytes to a budget. The destructor releases the bytes.
class MemoryCharge {
 public:
  MemoryCharge() = default;
  // Throws like MemoryBudget::charge() if the bytes do not fit.
  MemoryCharge(MemoryBudget& budget, uint64_t bytes, std::string_view what)
      : budget_(&budget), bytes_(bytes) {
    budget.charge(bytes, what);
  }
  MemoryCharge(MemoryCharge&& other) noexcept { swap(other); }
  MemoryCharge& operator=(MemoryCharge&& other) noexcept {
    MemoryCharge(static_cast<MemoryCharge&&>(other)).swap(*this);
    return *this;
  }
  ~MemoryCharge() {
    if (budget_) budget_->release(bytes_);
  }
  // Grows or shrinks the charge to `bytes`. Returns false without a change if the new size does not
  // fit.
  bool try_resize(uint64_t bytes);
  uint64_t bytes() const { return bytes_; }

 private:
  void swap(MemoryCharge& other) noexcept {
    MemoryBudget* b = budget_;
    budget_ = other.budget_;
    other.budget_ = b;
    const uint64_t n = bytes_;
    bytes_ = other.bytes_;
    other.bytes_ = n;
  }

  MemoryBudget* budget_ = nullptr;
  uint64_t bytes_ = 0;
};

}  // namespace voxdag
