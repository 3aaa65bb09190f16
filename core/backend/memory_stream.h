// A TriangleStream over triangles that are in memory.
#pragma once

#include <algorithm>
#include <span>

#include "core/backend/backend.h"

namespace voxdag {

// Does not copy the triangles, which must outlive the stream. Not thread-safe.
class MemoryStream : public TriangleStream {
 public:
  explicit MemoryStream(std::span<const FixedTriangle> triangles) : triangles_(triangles) {}
  uint64_t count() const override { return triangles_.size(); }
  void rewind() override { next_ = 0; }
  size_t read(std::span<FixedTriangle> out) override {
    const size_t n = std::min(out.size(), triangles_.size() - next_);
    std::copy_n(triangles_.begin() + static_cast<std::ptrdiff_t>(next_), n, out.begin());
    next_ += n;
    return n;
  }

 private:
  std::span<const FixedTriangle> triangles_;
  size_t next_ = 0;
};

}  // namespace voxdag
