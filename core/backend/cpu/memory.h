// Memory for one subvolume: buffers charged to its budget, and pages kept from one subvolume for
// the next, since fetching fresh ones from the system costs more than filling them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/memory_budget.h"

namespace voxdag::cpu {

// Thrown and caught within the backend when the budget is too small; becomes
// BuildOutcome::kOutgrown.
struct Outgrown {};

// Blocks of pages that wait to be used again. Not thread-safe.
class PagePool {
 public:
  PagePool() = default;
  PagePool(const PagePool&) = delete;
  PagePool& operator=(const PagePool&) = delete;
  ~PagePool();

  // The bytes that a block for `bytes` of them has: a power of two up to kLargestKept, whole pages
  // beyond.
  static size_t block_bytes(size_t bytes);
  // `bytes` must be block_bytes() of something. Contents are zero, or whatever they were if `zero`
  // is false. Throws Error{kOutOfMemory} when the system has no pages left.
  void* take(size_t bytes, bool zero);
  // A block with the contents of an old one, whose pages it takes over.
  void* grow(void* block, size_t bytes, size_t new_bytes);
  void give_back(void* block, size_t bytes) noexcept;

 private:
  static constexpr size_t kSmallest = size_t{4} << 10;
  static constexpr size_t kLargestKept = size_t{4} << 20;
  static constexpr size_t kMostKept = size_t{16} << 20;  // bytes, in all

  std::vector<std::vector<void*>> kept_ = std::vector<std::vector<void*>>(11);  // by size
  size_t kept_bytes_ = 0;
};

// Where the buffers of one build come from: charged to `budget` while they live.
struct Memory {
  MemoryBudget& budget;
  PagePool& pool;
};

// An array of at least the size asked for. Throws Outgrown if the budget cannot hold it.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  enum Contents { kAny, kZero };

  Buffer() = default;
  Buffer(Memory& memory, size_t size, Contents contents = kAny) : memory_(&memory) {
    bytes_ = PagePool::block_bytes(size * sizeof(T));
    if (!memory.budget.try_charge(bytes_)) throw Outgrown{};
    try {
      data_ = static_cast<T*>(memory.pool.take(bytes_, contents == kZero));
    } catch (...) {
      memory.budget.release(bytes_);
      throw;
    }
  }
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    Buffer(std::move(other)).swap(*this);
    return *this;
  }
  ~Buffer() {
    if (!data_) return;
    memory_->pool.give_back(data_, bytes_);
    memory_->budget.release(bytes_);
  }

  // Makes the size at least `size`, and larger than it was by a quarter. What is there stays; the
  // rest is undefined.
  void grow(Memory& memory, size_t size) {
    if (!data_) {
      *this = Buffer(memory, size);
      return;
    }
    const size_t least = size * sizeof(T), ample = bytes_ + bytes_ / 4;
    const size_t bytes = PagePool::block_bytes(least > ample ? least : ample);
    // Both are there for a moment unless the system moves the pages; the charge is for one.
    if (!memory.budget.try_charge(bytes - bytes_)) throw Outgrown{};
    try {
      data_ = static_cast<T*>(memory.pool.grow(data_, bytes_, bytes));
    } catch (...) {
      memory.budget.release(bytes - bytes_);
      throw;
    }
    bytes_ = bytes;
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  size_t size() const { return bytes_ / sizeof(T); }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  T* begin() { return data_; }
  T* end() { return data_ + size(); }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size(); }

 private:
  void swap(Buffer& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
  }

  Memory* memory_ = nullptr;
  T* data_ = nullptr;
  size_t bytes_ = 0;
};

}  // namespace voxdag::cpu
