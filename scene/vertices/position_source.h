// The stored vertex positions of a mesh: the input of a VertexCache.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag {

class PositionSource {
 public:
  virtual ~PositionSource() = default;
  virtual uint64_t count() const = 0;
  // Writes the positions of vertices [first, first + count) to `out`, three doubles each.
  virtual void read(uint64_t first, size_t count, double* out) = 0;
};

}  // namespace voxdag
