// A triangle mesh in memory, as the scene of a build.
#pragma once

#include <cstdint>
#include <span>
#include <variant>

namespace voxdag {

// The spans refer to arrays of the caller. The arrays must not change or move until the build
// returns.
struct Mesh {
  // x, y and z of each vertex, in any units. Doubles are not rounded to floats.
  std::variant<std::span<const float>, std::span<const double>> positions;
  // Three vertex numbers for each triangle. Degenerate triangles set voxels like all other
  // triangles.
  std::span<const uint32_t> indices;
  // Red, green, blue and alpha of each vertex, in sRGB; alpha is linear. If the span is empty, all
  // vertices are white.
  std::span<const uint8_t> colors = {};
};

}  // namespace voxdag
