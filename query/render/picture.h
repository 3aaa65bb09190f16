// A picture of 8-bit sRGB pixels, with or without alpha.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::query {

struct Picture {
  int width = 0, height = 0, channels = 3;
  std::vector<uint8_t> bytes;  // rows from the top; red, green, blue, and with 4 channels alpha

  Picture(int w, int h, int c = 3)
      : width(w),
        height(h),
        channels(c),
        bytes(static_cast<size_t>(c) * static_cast<size_t>(w) * static_cast<size_t>(h)) {}
  uint8_t* pixel(int x, int y) {
    return &bytes[static_cast<size_t>(channels) *
                  (static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x))];
  }
};

// Returns the picture as a PNG file, which names voxdag as its software. Throws Error{kOutOfMemory}
// if libpng runs out of memory.
std::string encode_png(const Picture& picture);
// True if the name has an ending of JPEG files, such as .jpg.
bool is_jpeg_name(std::string_view path);
// Returns the picture as a JPEG file if is_jpeg_name(path), otherwise as a PNG file. Throws
// Error{kInvalidInput} for a JPEG file of a picture with alpha.
std::string encode_picture(const Picture& picture, std::string_view path);
// True if the file was written by encode_picture() or encode_png().
bool is_rendered_picture(const ReadableFile& file);

}  // namespace voxdag::query
