// Triangulates the faces of an indexed mesh, whose corners are vertex indices. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "scene/polygon/triangulator.h"
#include "scene/vertices/position_source.h"
#include "scene/vertices/vertex_cache.h"

namespace voxdag::polygon {

class FaceSplitter {
 public:
  // `cursors` is the number of cursors that share the budget. `path` is the file, for messages. The
  // vertices and the budget must outlive this object.
  FaceSplitter(PositionSource& vertices, const std::string& path, unsigned cursors,
               MemoryBudget& budget)
      : vertex_count_(vertices.count()),
        cache_(budget, vertex_count_, cursors),
        triangulator_(budget, "a polygon of " + path) {
    cache_.bind(vertices);
    cache_.place(Transform{}, nullptr);
  }

  // Triangulates a face of at least three corners. Returns the triangles as three positions in
  // `corners` each, valid until the next call. Returns nothing if the triangles are the fan around
  // the first corner. A face with a vertex that does not exist becomes this fan.
  std::span<const uint32_t> split(std::span<const uint32_t> corners) {
    is_doubtful_ = false;
    if (corners.size() == 3 || !load(corners)) return {};
    const bool is_split = triangulator_.triangulate(xyz_);
    is_doubtful_ = triangulator_.is_doubtful();
    return is_split ? triangulator_.triangles() : std::span<const uint32_t>();
  }
  // True if the last face is only read as a fan because its edges cross each other
  // (triangulator.h).
  bool is_doubtful() const { return is_doubtful_; }

 private:
  bool load(std::span<const uint32_t> corners) {
    xyz_.resize(3 * corners.size());
    for (size_t i = 0; i < corners.size(); ++i) {
      if (corners[i] >= vertex_count_) return false;
      std::copy_n(cache_.at(corners[i]), 3, &xyz_[3 * i]);
    }
    return true;
  }

  const uint64_t vertex_count_;
  VertexCache cache_;
  Triangulator triangulator_;
  std::vector<double> xyz_;  // the corners of the face
  bool is_doubtful_ = false;
};

}  // namespace voxdag::polygon
