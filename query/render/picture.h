// A picture of 8-bit sRGB pixels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::query {

struct Picture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  // rows from the top, 3 bytes per pixel

  Picture(int w, int h)
      : width(w), height(h), rgb(3 * static_cast<size_t>(w) * static_cast<size_t>(h)) {}
  uint8_t* pixel(int x, int y) {
    return &rgb[3 * (static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x))];
  }
};

// Returns the picture as a PNG file, which names voxdag as its software. Throws Error{kOutOfMemory}
// if libpng runs out of memory.
std::string encode_png(const Picture& picture);
// True if the file was written by encode_png().
bool is_rendered_png(const ReadableFile& file);

}  // namespace voxdag::query
