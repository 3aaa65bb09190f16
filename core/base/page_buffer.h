// A large array straight from the system: zero-filled pages, given back at once when released,
// huge pages asked for where that helps. The general allocator keeps freed memory, which would
// break the memory promise; tables and level arrays live here instead. Not thread-safe.
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

// Throws Error{kOutOfMemory} naming `what` when the system has no pages left.
void* allocate_pages(size_t bytes, std::string_view what);
// Moves pages, if need be, to where more zero-filled ones follow them; their bytes are not copied.
void* grow_pages(void* pages, size_t bytes, size_t new_bytes, std::string_view what);
void free_pages(void* pages, size_t bytes);

template <class T>
class PageBuffer {
  static_assert(std::is_trivially_copyable_v<T>, "pages are handed out zero-filled");

 public:
  PageBuffer() = default;
  // Charged to `budget`; throws Error{kOutOfMemory} naming `what` if it does not fit.
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

  // Grows a buffer that is not empty, contents kept, new elements zero. Throws Error{kOutOfMemory}
  // naming `what`, and is unchanged, if it does not fit.
  void grow(size_t size, std::string_view what) {
    const uint64_t old_bytes = charge_.bytes();
    if (!charge_.try_resize(byte_count(size)))
      throw Error(ErrorCode::kOutOfMemory, std::string(what) + " outgrew the memory budget");
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
  // Where 64 bits do not hold it: more than there ever is.
  static uint64_t byte_count(size_t size) {
    return size <= SIZE_MAX / sizeof(T) ? size * sizeof(T) : UINT64_MAX;
  }

  MemoryCharge charge_;
  T* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace voxdag
