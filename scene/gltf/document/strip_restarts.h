// Triangle strips and fans that restart at the largest index of their type
// (KHR_mesh_primitive_restart).
#pragma once

#include <cstdint>
#include <vector>

namespace voxdag::gltf {

// Takes the indices of a strip or fan one by one, and finds the triangles that they complete.
class StripWalk {
 public:
  StripWalk(bool is_fan, uint32_t restart) : is_fan_(is_fan), restart_(restart) {}

  // Takes the next index. If it completes a triangle, writes the triangle's three corners and
  // returns true. Every second triangle of a strip has its first two corners exchanged, so all
  // triangles of a strip have one winding.
  bool add(uint32_t index, uint32_t* corners) {
    if (index == restart_) {
      length_ = 0;
      return false;
    }
    const bool completes = ++length_ > 2;
    if (completes) {
      const bool is_swapped = !is_fan_ && length_ % 2 == 0;
      corners[0] = is_swapped ? previous_ : first_;
      corners[1] = is_swapped ? first_ : previous_;
      corners[2] = index;
    }
    if (length_ == 1 || (!is_fan_ && length_ > 2)) first_ = completes ? previous_ : index;
    previous_ = index;
    return completes;
  }

 private:
  bool is_fan_;
  uint32_t restart_;
  uint32_t first_ = 0;     // first corner of the next triangle, once there are two indices
  uint32_t previous_ = 0;  // second corner of the next triangle
  uint64_t length_ = 0;    // number of indices since the last restart
};

// Finds the triangles in the indices of a strip or fan that restarts.
struct RestartIndex {
  static constexpr uint64_t kTriangles = 1024;
  // The state of the walk just before it takes index `at`, which completes a triangle.
  struct Entry {
    uint64_t at;
    StripWalk walk;
  };
  uint64_t triangles = 0;
  std::vector<Entry> entries;  // one for every kTriangles-th triangle
};

}  // namespace voxdag::gltf
