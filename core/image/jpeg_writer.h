// Writes JPEG images.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace voxdag {

// True if this program was built with libjpeg.
bool can_write_jpeg();
// Returns the bytes of a JPEG file of 8-bit sRGB pixels: rows from the top, 3 bytes per pixel. The
// file's first comment segment has the text `comment` and begins at byte 20 of the file. Throws
// Error{kInvalidInput} if this program was built without libjpeg, and Error{kOutOfMemory}.
std::string encode_jpeg(uint32_t width, uint32_t height, std::span<const uint8_t> rgb,
                        std::string_view comment);

}  // namespace voxdag
