// A triangle mesh in memory, as the scene of a build.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>

namespace voxdag {

// The spans refer to arrays of the caller. The arrays must not change or move until the build
// returns.
struct Mesh {
  // x, y and z of each vertex, in any units. Doubles are not rounded to floats.
  std::variant<std::span<const float>, std::span<const double>> positions;
  // Three vertex indices, counted from 0, for each triangle. Degenerate triangles set voxels like
  // all other triangles. Without triangles, each vertex is a point, which sets one voxel.
  std::span<const uint32_t> indices;
  // Red, green, blue and alpha of each vertex, in sRGB; alpha is linear. If the span is empty, all
  // vertices are white.
  std::span<const uint8_t> colors = {};
  // The texture: the bytes of an image file, and its coordinates s and t for each vertex. t is 0 at
  // the lower edge of the image. A mesh with a texture has only the colors of the texture; `colors`
  // is ignored. If `texture` or `texture_coordinates` is empty, the mesh has no texture.
  std::span<const std::byte> texture = {};
  std::span<const float> texture_coordinates = {};
  // Name of the texture's material. Meshes of one scene that have different textures must have
  // different names.
  std::string texture_name = "texture";
};

}  // namespace voxdag
