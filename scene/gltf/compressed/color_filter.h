// Decodes the filter COLOR of KHR_meshopt_compression (appendix B, filter 4).
#pragma once

#include <cstddef>
#include <span>

namespace voxdag::gltf {

// Replaces Y, Co, Cg and alpha of each element by red, green, blue and alpha. A component has 8
// bits if `stride` is 4, and 16 bits if it is 8.
void decode_color_filter(std::span<std::byte> elements, size_t stride);

}  // namespace voxdag::gltf
