// The triangles of a point: one degenerate triangle, or the surface of a cube.
//
//        6-------7       bits of a corner number: 1 high x, 2 high y, 4 high z
//       /|      /|
//      4-------5 |       z
//      | 2-----|-3       | y
//      |/      |/        |/
//      0-------1         0--x
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/geometry/grid.h"

namespace voxdag::points {

inline constexpr uint64_t kCubeTriangles = 12;

// Returns the corner numbers of the cube's triangles. The corners of a triangle run
// counterclockwise when seen from outside.
constexpr std::array<std::array<uint8_t, 3>, kCubeTriangles> cube_triangles() {
  std::array<std::array<uint8_t, 3>, kCubeTriangles> all{};
  size_t n = 0;
  for (unsigned axis = 0; axis < 3; ++axis)
    for (unsigned side = 0; side < 2; ++side) {
      const unsigned u = 1U << (axis + 1) % 3, v = 1U << (axis + 2) % 3;
      const auto base = static_cast<uint8_t>(side << axis);
      const auto next = static_cast<uint8_t>(base | (side ? u : v));
      const auto far = static_cast<uint8_t>(base | u | v);
      const auto last = static_cast<uint8_t>(base | (side ? v : u));
      all[n++] = {base, next, far};
      all[n++] = {base, far, last};
    }
  return all;
}

// Returns triangle `number` of the cube with the low corner `low` and the high corner `high`.
inline RealTriangle cube_triangle(const double* low, const double* high, size_t number) {
  static constexpr auto kCorners = cube_triangles();
  RealTriangle triangle;
  for (size_t k = 0; k < 3; ++k)
    for (size_t a = 0; a < 3; ++a)
      triangle.v[k][a] = kCorners[number][k] >> a & 1 ? high[a] : low[a];
  return triangle;
}

}  // namespace voxdag::points
