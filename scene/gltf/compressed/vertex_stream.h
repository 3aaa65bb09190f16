// Decodes version 1 of meshoptimizer's vertex streams (KHR_meshopt_compression, appendix A, mode
// 0). Common versions of libmeshoptimizer only decode version 0.
#pragma once

#include <cstddef>
#include <span>

namespace voxdag::gltf {

// True if the bytes begin like a vertex stream of version 1.
bool is_vertex_stream_1(std::span<const std::byte> stream);

// Decodes elements of `stride` bytes, a multiple of 4 up to 256, until `out` is full. Returns false
// if the stream is not valid. Allocates no memory.
bool decode_vertex_stream_1(std::span<const std::byte> stream, size_t stride,
                            std::span<std::byte> out);

}  // namespace voxdag::gltf
