// Memory for the build of one subvolume: arrays charged to its budget. The pages of a freed array
// are cached for later arrays, because getting new pages from the system takes longer than filling
// them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/memory_budget.h"

namespace voxdag {

// A cache of free page ranges. Not thread-safe.
class PagePool {
 public:
  struct Pages {
    void* data = nullptr;
    size_t bytes = 0;
  };

  PagePool() = default;
  PagePool(const PagePool&) = delete;
  PagePool& operator=(const PagePool&) = delete;
  ~PagePool() { clear(); }

  // Returns the size of a new range of pages that can store `bytes` bytes: the next power of two up
  // to 4 MiB, and above it the next multiple of 2 MiB, the size of a huge page. The system aligns a
  // range to huge pages, and moves it without dividing them, only if its size is such a multiple.
  static size_t range_bytes(size_t bytes);
  // Removes and returns the smallest cached range of `bytes` to `max_bytes` bytes. Returns a range
  // with null data if no range fits.
  Pages take(size_t bytes, size_t max_bytes);
  // Caches the range. Frees the oldest ranges if the cache would exceed `max_cached` bytes.
  void put(Pages pages, size_t max_cached) noexcept;
  void clear() noexcept;
  size_t cached_bytes() const { return cached_bytes_; }

 private:
  void free_oldest() noexcept;

  std::vector<Pages> cached_;  // oldest first
  size_t cached_bytes_ = 0;
};

// Allocates the arrays of one build. An array is charged to `budget` during its lifetime. Cached
// pages are not charged. If the budget cannot hold the cached pages and a new allocation together,
// all cached pages are freed.
class PooledMemory {
 public:
  MemoryBudget& budget;
  PagePool& pool;

  // Returns range_bytes(bytes) bytes of zeroed pages. If `zero` is false, returns up to twice as
  // many bytes, with undefined contents. Throws OutOfBudget if the budget has no space,
  // Error{kOutOfMemory} if the system has none.
  PagePool::Pages allocate(size_t bytes, bool zero);
  // Enlarges a range and preserves its contents. Throws like allocate(); the range is then
  // unchanged.
  void grow(PagePool::Pages& pages, size_t bytes);
  void free(PagePool::Pages pages) noexcept;

 private:
  void charge(size_t bytes);
  // Moves the contents of `pages` to a cached range of `bytes` to 2 * `bytes` bytes, because new
  // pages take longer than a copy. Returns false, with `pages` unchanged, if there is no such range
  // or the budget has no space for both ranges.
  bool move_to_cached(PagePool::Pages& pages, size_t bytes);
};

// An array of at least `size` elements, in cached or new pages. Throws like
// PooledMemory::allocate().
template <class T>
class PooledArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  enum Contents { kAny, kZero };

  PooledArray() = default;
  PooledArray(PooledMemory& memory, size_t size, Contents contents = kAny)
      : memory_(&memory), pages_(memory.allocate(size * sizeof(T), contents == kZero)) {}
  PooledArray(PooledArray&& other) noexcept { swap(other); }
  PooledArray& operator=(PooledArray&& other) noexcept {
    PooledArray(std::move(other)).swap(*this);
    return *this;
  }
  ~PooledArray() {
    if (pages_.data) memory_->free(pages_);
  }

  // Increases the size to at least `size`, and by at least a quarter. The old elements are
  // preserved; the new elements are undefined.
  void grow(PooledMemory& memory, size_t size) {
    if (!pages_.data) {
      *this = PooledArray(memory, size);
      return;
    }
    const size_t needed = size * sizeof(T), ample = pages_.bytes + pages_.bytes / 4;
    memory.grow(pages_, needed > ample ? needed : ample);
  }

  T* data() { return static_cast<T*>(pages_.data); }
  const T* data() const { return static_cast<const T*>(pages_.data); }
  size_t size() const { return pages_.bytes / sizeof(T); }
  T& operator[](size_t i) { return data()[i]; }
  const T& operator[](size_t i) const { return data()[i]; }
  T* begin() { return data(); }
  T* end() { return data() + size(); }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size(); }

 private:
  void swap(PooledArray& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(pages_, other.pages_);
  }

  PooledMemory* memory_ = nullptr;
  PagePool::Pages pages_;
};

}  // namespace voxdag
