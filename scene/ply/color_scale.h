// Converts the colors of a PLY file to linear light. Red, green and blue are sRGB; alpha is linear.
//
// PLY does not define the number that stands for full intensity. It is derived from the type and
// from the largest number: it is the smallest of 1 (only for float and double), 255, and 65535 that
// is at least half of the largest number of the element. Types of 8 bits always have 255. The
// largest number is common to the channels red, green and blue of one type. Numbers outside of the
// range from 0 to full intensity are clamped.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/ply/rows/header.h"

namespace voxdag::ply {

using Color = std::array<uint16_t, 4>;

class ColorScale {
 public:
  ColorScale() = default;
  // `types` are the types of red, green, blue and, if present, alpha.
  explicit ColorScale(std::vector<Type> types);

  // True if add() must be called for all colors of the element before to_color().
  bool needs_numbers() const;
  // Takes a color, one number per channel, into account. Ignores numbers that are not finite.
  void add(const double* numbers);
  void set_full_intensities();

  size_t channels() const { return types_.size(); }
  // Returns the color in the units of SurfaceCorner.
  Color to_color(const double* numbers) const;

 private:
  uint16_t light_of(double number, double full) const;

  std::vector<Type> types_;
  std::vector<double> largest_, full_;  // by channel
  std::array<uint16_t, 256> light_of_byte_{};
};

}  // namespace voxdag::ply
