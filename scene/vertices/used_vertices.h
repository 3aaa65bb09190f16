// Collects the vertices that some triangles use, to find the bounds of these triangles. If the
// vertex indices are close together, as in most meshes, each vertex is collected once. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/grid.h"
#include "scene/vertices/vertex_cache.h"

namespace voxdag {

class UsedVertices {
 public:
  // Replaces the collected vertices by the vertices with the indices `corners`. There must be at
  // least one corner.
  void find(std::span<const uint32_t> corners);
  void clear() { vertices_.clear(); }
  bool is_empty() const { return vertices_.empty(); }

  // Adds the positions of the vertices to `bounds`. Returns false, with the bounds unchanged, if a
  // position is not finite or an index is not below `count`, the number of vertices.
  bool add_to(WorldBounds& bounds, VertexCache& positions, uint64_t count) const;

 private:
  // Duplicates are removed if no two indices differ by more than this.
  static constexpr uint32_t kMaxRange = 65536;

  std::vector<uint32_t> vertices_;
  std::vector<uint8_t> is_used_;
  uint32_t highest_ = 0;
};

}  // namespace voxdag
