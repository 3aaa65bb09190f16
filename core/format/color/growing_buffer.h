// An array that grows when elements are appended. Its memory is charged to a budget. `what` names
// the array's contents in error messages.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

#include "core/base/page_buffer.h"

namespace voxdag {

template <class T>
class GrowingBuffer {
 public:
  GrowingBuffer(MemoryBudget& budget, const char* what) : budget_(&budget), what_(what) {}
  void append(std::span<const T> values) {
    if (values.empty()) return;
    reserve(size_ + values.size());
    std::memcpy(buffer_.data() + size_, values.data(), values.size_bytes());
    size_ += values.size();
  }
  std::span<const T> values() const { return std::span(buffer_.data(), size_); }
  T& last() { return buffer_[size_ - 1]; }
  bool empty() const { return size_ == 0; }
  void clear() { size_ = 0; }

 private:
  static constexpr size_t kFirstBytes = 4096;
  void reserve(size_t size) {
    if (size <= buffer_.size()) return;
    const size_t larger = std::max(size, 2 * buffer_.size());
    if (buffer_.size() == 0)
      buffer_ = PageBuffer<T>(*budget_, std::max(larger, kFirstBytes / sizeof(T)), what_);
    else
      buffer_.grow(larger, what_);
  }

  MemoryBudget* budget_;
  const char* what_;
  PageBuffer<T> buffer_;
  size_t size_ = 0;
};

}  // namespace voxdag
