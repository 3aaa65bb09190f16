// SHA-256 over the grid and the snapped triangles in their order: names the content of a scene. A
// plain value, so that a checkpoint can store it and a later run continue it.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "core/geometry/fixed_triangle.h"
#include "core/geometry/grid.h"

namespace voxdag {

class ContentDigest {
 public:
  ContentDigest() = default;
  explicit ContentDigest(const Grid& grid);
  void add(std::span<const FixedTriangle> triangles);
  // 64 lower-case hex digits of what was added so far.
  std::string hex() const;
  // Whether the state, if it was read from a file, is one that add() can continue.
  bool is_sound() const;

 private:
  void add_bytes(std::span<const std::byte> bytes);

  std::array<std::byte, 112> state_{};
};

}  // namespace voxdag
