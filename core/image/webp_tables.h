// Upper bound of the memory for the decoding tables of a lossless WebP stream. An image can declare
// 65536 sets of tables in a few kilobytes, so the bound is needed before the stream is decoded.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace voxdag {

// Returns the bound in bytes for a lossless stream ("VP8L"), or nullopt if the stream is broken.
// Reads the stream up to the number of its sets of Huffman tables. `stream` begins with the
// transforms.
std::optional<uint64_t> webp_table_bytes(std::span<const uint8_t> stream, uint32_t width,
                                         uint32_t height);

}  // namespace voxdag
