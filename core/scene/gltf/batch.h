// Gathers triangles until a batch is full and hands it to the visitor.
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "core/base/cancel_token.h"
#include "core/base/page_buffer.h"
#include "core/geometry/grid.h"

namespace voxdag::gltf {

class Batch {
 public:
  using Visitor = std::function<void(std::span<const WorldTriangle>)>;
  static constexpr size_t kTriangles = 4096;

  Batch(const Visitor& visit, MemoryBudget& budget, const CancelToken& cancel)
      : visit_(visit), cancel_(cancel), triangles_(budget, kTriangles, "a batch of triangles") {}

  // Where the next triangle goes; it counts once keep() is called.
  WorldTriangle& next() { return triangles_[size_]; }
  void keep() {
    if (++size_ == kTriangles) flush();
  }
  // Call once at the end.
  void flush() {
    cancel_.check();
    if (size_ > 0) visit_(std::span<const WorldTriangle>(triangles_.data(), size_));
    size_ = 0;
  }
  void check_cancelled() const { cancel_.check(); }

 private:
  const Visitor& visit_;
  const CancelToken& cancel_;
  PageBuffer<WorldTriangle> triangles_;
  size_t size_ = 0;
};

}  // namespace voxdag::gltf
