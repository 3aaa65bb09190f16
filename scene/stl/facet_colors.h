// The colors of the facets of binary STL files. The format has no colors, but programs store 15
// bits of color in the attribute of a facet:
//
//   VisCAM, SolidView   bit 15 is 1 if the facet has a color; bits 0-4 blue, 5-9 green, 10-14 red
//   Materialise Magics  bit 15 is 0 if the facet has its own color; bits 0-4 red, 5-9 green, 10-14
//                       blue. The header has "COLOR=" and four bytes: red, green, blue and alpha
//                       of all other facets.
//
// Colors are sRGB. The alpha is not used. A facet without color is white.
#pragma once

#include <array>
#include <cstdint>

#include "core/io/file_system.h"

namespace voxdag::stl {

class FacetColors {
 public:
  using Color = std::array<uint16_t, 4>;

  // Reads the header of a binary file.
  explicit FacetColors(const ReadableFile& file);

  // Returns the color of a facet in the units of SurfaceCorner.
  Color color_of(uint16_t attribute) const {
    const bool has_bit = (attribute & 0x8000) != 0;
    if (has_bit == is_materialise_) return default_;
    const Color low_first{light_[attribute & 31], light_[attribute >> 5 & 31],
                          light_[attribute >> 10 & 31], default_[3]};
    if (is_materialise_) return low_first;
    return {low_first[2], low_first[1], low_first[0], low_first[3]};
  }

 private:
  std::array<uint16_t, 32> light_;
  Color default_;
  bool is_materialise_ = false;
};

}  // namespace voxdag::stl
