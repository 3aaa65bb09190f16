// Collects triangles into batches for the visitor of a pass, and counts them. Not thread-safe.
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

// How far a pass over the triangles has come.
struct PassPosition {
  uint64_t triangles = 0;  // skipped and invalid ones included
  uint64_t invalid = 0;    // skipped ones not included
};

class Batch {
 public:
  using Visitor = std::function<void(std::span<const WorldTriangle>)>;
  static constexpr size_t kTriangles = 4096;

  // Counts in `position`. The first `skip_count` triangles of the pass are skipped.
  Batch(const Visitor& visit, PassPosition& position, uint64_t skip_count, MemoryBudget& budget,
        const CancelToken& cancel)
      : visit_(visit),
        position_(position),
        left_to_skip_(skip_count),
        cancel_(cancel),
        triangles_(budget, kTriangles, "a batch of triangles") {}

  // Skips the first of the next `count` triangles, as far as the pass requires, and returns how
  // many.
  uint64_t skip(uint64_t count) {
    const uint64_t skipped = std::min(count, left_to_skip_);
    left_to_skip_ -= skipped;
    position_.triangles += skipped;
    return skipped;
  }
  // The place of the next triangle, to be followed by add() or drop().
  WorldTriangle& next() { return triangles_[size_]; }
  // Adds the triangle in next() to the batch.
  void add() {
    ++position_.triangles;
    if (++size_ == kTriangles) flush();
  }
  // Counts an invalid triangle.
  void drop() {
    ++position_.triangles;
    ++position_.invalid;
  }
  // Passes the triangles of an incomplete batch on. Call at the end of the pass.
  void flush() {
    cancel_.check();
    if (size_ > 0) visit_(std::span<const WorldTriangle>(triangles_.data(), size_));
    size_ = 0;
  }
  void check_canceled() const { cancel_.check(); }

 private:
  const Visitor& visit_;
  PassPosition& position_;
  uint64_t left_to_skip_;
  const CancelToken& cancel_;
  PageBuffer<WorldTriangle> triangles_;
  size_t size_ = 0;
};

}  // namespace voxdag::gltf
