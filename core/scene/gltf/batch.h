// Gathers triangles until a batch is full and hands it to the visitor; counts what went by.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "core/base/cancel_token.h"
#include "core/base/page_buffer.h"
#include "core/geometry/grid.h"

namespace voxdag::gltf {

// Triangles of a pass, those that were jumped over and the invalid ones included.
struct Passed {
  uint64_t triangles = 0;
  uint64_t invalid = 0;  // of those that were looked at
};

class Batch {
 public:
  using Visitor = std::function<void(std::span<const WorldTriangle>)>;
  static constexpr size_t kTriangles = 4096;

  // Counts into `passed`; the first `skipped` triangles are to be jumped over.
  Batch(const Visitor& visit, Passed& passed, uint64_t skipped, MemoryBudget& budget,
        const CancelToken& cancel)
      : visit_(visit),
        passed_(passed),
        left_to_skip_(skipped),
        cancel_(cancel),
        triangles_(budget, kTriangles, "a batch of triangles") {}

  // How many of the next `count` triangles are to be jumped over, and counts them as passed.
  uint64_t skip(uint64_t count) {
    const uint64_t skipped = std::min(count, left_to_skip_);
    left_to_skip_ -= skipped;
    passed_.triangles += skipped;
    return skipped;
  }
  // Where the next triangle goes; it counts once keep() or drop() is called.
  WorldTriangle& next() { return triangles_[size_]; }
  void keep() {
    ++passed_.triangles;
    if (++size_ == kTriangles) flush();
  }
  void drop() {
    ++passed_.triangles;
    ++passed_.invalid;
  }
  // Call once at the end.
  void flush() {
    cancel_.check();
    if (size_ > 0) visit_(std::span<const WorldTriangle>(triangles_.data(), size_));
    size_ = 0;
  }
  void check_canceled() const { cancel_.check(); }

 private:
  const Visitor& visit_;
  Passed& passed_;
  uint64_t left_to_skip_;
  const CancelToken& cancel_;
  PageBuffer<WorldTriangle> triangles_;
  size_t size_ = 0;
};

}  // namespace voxdag::gltf
