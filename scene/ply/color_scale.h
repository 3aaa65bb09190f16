// Converts the colors of a PLY file to linear light. Red, green and blue are sRGB; alpha is linear.
//
// PLY does not define which number is full intensity. For 8-bit types, full intensity is 255. For
// other types, it follows from the largest color number of the element (the vertices or the faces):
// full intensity is 1 if this number is at most 2 (only for float and double), 255 if it is at most
// 510, and otherwise 65535. Red, green and blue share the largest number if they have the same
// type. Numbers below 0 or above full intensity are clamped.
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

  // True if add() must be called with all colors of the element before set_full_intensities().
  bool needs_numbers() const;
  // Updates the largest number of each channel. `numbers` is a color, with one number per channel.
  // Ignores non-finite numbers.
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
