// A large array of zero-filled pages allocated directly from the system; arrays of 2 MiB or more
// request huge pages. Tables and level arrays use this buffer because freed pages return to the
// system immediately, which the general allocator does not guarantee. Arrays of at most 128 KiB
// use the general allocator, because a small build would otherwise make hundreds of system calls
// for them. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "core/base/error.h"
#include "core/base/memory_budget.h"

namespace voxdag {

// Returns `bytes` bytes of zero-filled memory: pages or, for a small array, memory that is aligned
// to 64 bytes. Throws Error{kOutOfMemory} if the system refuses. The message contains `what`, the
// purpose of the pages.
void* allocate_pages(size_t bytes, std::string_view what);
// Grows an allocation from `bytes` to `new_bytes` bytes and returns its address, which can be a new
// one. The new pages are zero-filled. The old pages can get new addresses, but their bytes are not
// copied (except in builds with ThreadSanitizer). Throws like allocate_pages().
void* grow_pages(void* pages, size_t bytes, size_t new_bytes, std::string_view what);
void free_pages(void* pages, size_t bytes);
// Throws Error{kOutOfMemory}: the memory budget has no `bytes` bytes for `what`.
[[noreturn]] void refuse_growth(size_t bytes, std::string_view what);

template <class T>
class PageBuffer {
  static_assert(std::is_trivially_copyable_v<T>, "the pages are zero-filled");

 public:
  PageBuffer() = default;
  // Allocates `size` zero elements and charges them to `budget`. Throws Error{kOutOfMemory} if they
  // do not fit. The message contains `what`, the purpose of the buffer.
  PageBuffer(MemoryBudget& budget, size_t size, std::string_view what)
      : charge_(budget, byte_count(size), what),
        data_(size ? static_cast<T*>(allocate_pages(byte_count(size), what)) : nullptr),
        size_(size) {}
  PageBuffer(PageBuffer&& other) noexcept
      : charge_(std::move(other.charge_)),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)) {}
  PageBuffer& operator=(PageBuffer&& other) noexcept {
    if (this != &other) {
      if (data_) free_pages(data_, size_ * sizeof(T));
      charge_ = std::move(other.charge_);
      data_ = std::exchange(other.data_, nullptr);
      size_ = std::exchange(other.size_, 0);
    }
    return *this;
  }
  ~PageBuffer() {
    if (data_) free_pages(data_, size_ * sizeof(T));
  }

  // Enlarges the buffer, which must not be empty, to `size` elements. The new elements are zero.
  // Throws an Error{kOutOfMemory} that names `what`, the purpose of the buffer, if the new size
  // does not fit; the buffer is then unchanged.
  void grow(size_t size, std::string_view what) {
    const uint64_t old_bytes = charge_.bytes();
    if (!charge_.try_resize(byte_count(size))) refuse_growth(byte_count(size), what);
    try {
      data_ = static_cast<T*>(grow_pages(data_, old_bytes, byte_count(size), what));
    } catch (...) {
      charge_.try_resize(old_bytes);
      throw;
    }
    size_ = size;
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  size_t size() const { return size_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }

 private:
  // Returns the number of bytes in `size` elements. If this number overflows, returns UINT64_MAX,
  // which exceeds every budget.
  static uint64_t byte_count(size_t size) {
    return size <= SIZE_MAX / sizeof(T) ? size * sizeof(T) : UINT64_MAX;
  }

  MemoryCharge charge_;
  T* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace voxdag
