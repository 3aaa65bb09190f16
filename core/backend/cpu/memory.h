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
  struct Block {
    void* pages = nullptr;
    size_t bytes = 0;
  };

  PagePool() = default;
  PagePool(const PagePool&) = delete;
  PagePool& operator=(const PagePool&) = delete;
  ~PagePool() { clear(); }

  // What a block for `bytes` has when it is new: a power of two up to 4 MiB, whole pages beyond.
  static size_t block_bytes(size_t bytes);
  // The smallest kept block of `bytes` to `most` bytes. Null if there is none.
  Block take_kept(size_t bytes, size_t most);
  // Keeps the block; those that were kept longest go where there would be more than `max_kept`.
  void give_back(Block block, size_t max_kept) noexcept;
  void clear() noexcept;
  size_t kept_bytes() const { return kept_bytes_; }

 private:
  void free_oldest() noexcept;

  std::vector<Block> kept_;  // the oldest first
  size_t kept_bytes_ = 0;
};

// Where the buffers of one build come from: charged to `budget` while they live. What the pool
// keeps is not, but makes way for what would not fit beside it.
class Memory {
 public:
  MemoryBudget& budget;
  PagePool& pool;

  // A block of block_bytes(bytes), zero, or, if `zero` is false, one of up to twice that with any
  // contents; charged. Throws Outgrown where the budget has no room, Error{kOutOfMemory} where the
  // system has none.
  PagePool::Block take(size_t bytes, bool zero);
  // Makes a block larger, keeping its contents. Throws likewise; the block is then as it was.
  void grow(PagePool::Block& block, size_t bytes);
  void give_back(PagePool::Block block) noexcept;

 private:
  void charge(size_t bytes);
};

// An array of at least the size asked for. Throws Outgrown if the budget cannot hold it.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  enum Contents { kAny, kZero };

  Buffer() = default;
  Buffer(Memory& memory, size_t size, Contents contents = kAny)
      : memory_(&memory), block_(memory.take(size * sizeof(T), contents == kZero)) {}
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    Buffer(std::move(other)).swap(*this);
    return *this;
  }
  ~Buffer() {
    if (block_.pages) memory_->give_back(block_);
  }

  // Makes the size at least `size`, and larger than it was by a quarter. What is there stays; the
  // rest is undefined.
  void grow(Memory& memory, size_t size) {
    if (!block_.pages) {
      *this = Buffer(memory, size);
      return;
    }
    const size_t least = size * sizeof(T), ample = block_.bytes + block_.bytes / 4;
    memory.grow(block_, least > ample ? least : ample);
  }

  T* data() { return static_cast<T*>(block_.pages); }
  const T* data() const { return static_cast<const T*>(block_.pages); }
  size_t size() const { return block_.bytes / sizeof(T); }
  T& operator[](size_t i) { return data()[i]; }
  const T& operator[](size_t i) const { return data()[i]; }
  T* begin() { return data(); }
  T* end() { return data() + size(); }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size(); }

 private:
  void swap(Buffer& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(block_, other.block_);
  }

  Memory* memory_ = nullptr;
  PagePool::Block block_;
};

}  // namespace voxdag::cpu
