// WebP and AVIF files, written with the libraries. The functions of a format exist only if voxdag
// is built with its library.
#pragma once

#include <cstdint>
#include <string>

namespace voxdag::test {

#ifdef VOXDAG_HAS_WEBP
// Returns a WebP file. `pixels` is RGBA with 8 bits. Lossless images also keep the colors of
// transparent pixels.
std::string webp_file(uint32_t width, uint32_t height, const std::string& pixels,
                      bool is_lossless = true);
// Returns an animation of one frame.
std::string animated_webp_file(uint32_t width, uint32_t height, const std::string& pixels);
#endif

#ifdef VOXDAG_HAS_AVIF
struct AvifFormat {
  uint32_t width = 1, height = 1;
  int bits = 8;      // 8, 10 or 12
  int chroma = 444;  // 444, 422, 420, or 400 for gray
  int matrix = 0;    // MatrixCoefficients of H.273; 0: the planes are green, blue and red
  bool is_limited = false;
  bool has_alpha = true;
  int tile_columns = 1;  // over 1: a grid of tiles in one row
};
// Returns an AVIF file. `pixels` is RGBA with 8 bits. The planes are encoded without loss.
std::string avif_file(const AvifFormat& format, const std::string& pixels);
// Returns the pixels that the library's own conversion gives for a file: RGBA with 8 bits.
std::string pixels_by_libavif(const std::string& file);
#endif

}  // namespace voxdag::test
