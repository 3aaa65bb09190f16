// A list in memory that is charged to a budget. Used for lists whose length is known only at the
// end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

#include "core/base/page_buffer.h"

namespace voxdag::query {

template <class T>
class GrowingBuffer {
 public:
  // `what` names the memory in error messages. This text must outlive the buffer.
  GrowingBuffer(MemoryBudget& budget, std::string_view what) : budget_(&budget), what_(what) {}

  // Throws Error{kOutOfMemory} if the list does not fit in the budget.
  void push_back(const T& value) {
    if (size_ == pages_.size()) grow();
    pages_[size_++] = value;
  }
  size_t size() const { return size_; }
  T& operator[](size_t i) { return pages_[i]; }
  const T& operator[](size_t i) const { return pages_[i]; }
  const T* data() const { return pages_.data(); }
  const T* begin() const { return pages_.data(); }
  const T* end() const { return pages_.data() + size_; }

 private:
  static constexpr size_t kFirstBytes = 4096;
  void grow() {
    if (pages_.size() == 0)
      pages_ = PageBuffer<T>(*budget_, std::max<size_t>(1, kFirstBytes / sizeof(T)), what_);
    else
      pages_.grow(pages_.size() + (pages_.size() + 1) / 2, what_);
  }

  MemoryBudget* budget_;
  std::string_view what_;
  PageBuffer<T> pages_;
  size_t size_ = 0;
};

}  // namespace voxdag::query
