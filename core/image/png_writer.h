// Writes PNG images.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace voxdag {

// Returns the bytes of a PNG file of 8-bit sRGB pixels: rows from the top, 3 bytes per pixel, or 4
// with alpha. Throws Error{kOutOfMemory} if libpng runs out of memory.
std::string encode_png(uint32_t width, uint32_t height, std::span<const uint8_t> pixels);

}  // namespace voxdag
