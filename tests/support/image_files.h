// PNG and JPEG files made by tests. PNG files are written byte by byte, JPEG files with the
// library.
#pragma once

#include <cstdint>
#include <string>

namespace voxdag::test {

struct PngFormat {
  uint32_t width = 1, height = 1;
  int depth = 8;
  int color_type = 6;  // 0 gray, 2 RGB, 3 palette, 4 gray and alpha, 6 RGBA
  std::string chunks;  // between IHDR and IDAT
  bool is_interlaced = false;
};
// Returns a chunk of a PNG file: length, type, data and checksum.
std::string png_chunk(const std::string& type, const std::string& data);
std::string big_endian(uint32_t value);
// Returns a PNG file. `pixels` has no filter bytes. Each row begins at a whole byte; in an
// interlaced file, each pixel does.
std::string png_file(const PngFormat& format, const std::string& pixels);

// Returns a JPEG file. `pixels` has 1 (gray), 3 (RGB) or 4 (CMYK) bytes per pixel.
std::string jpeg_file(uint32_t width, uint32_t height, int components, const std::string& pixels,
                      bool is_progressive = false);
// Returns a JPEG file of RGB `pixels` with one scan per channel. The last scan occurs `repeats`
// times.
std::string jpeg_of_scans(uint32_t width, uint32_t height, const std::string& pixels, int repeats);

}  // namespace voxdag::test
