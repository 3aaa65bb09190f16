#include "scene/ply/color_scale.h"

#include <algorithm>
#include <cmath>

#include "core/color/surface.h"
#include "scene/surface_numbers.h"
#include "scene/textures/linear_light.h"

namespace voxdag::ply {

ColorScale::ColorScale(std::vector<Type> types)
    : types_(std::move(types)), largest_(types_.size()), full_(types_.size(), 255) {
  for (size_t i = 0; i < light_of_byte_.size(); ++i)
    light_of_byte_[i] = linear_light(static_cast<double>(i) / 255);
}

bool ColorScale::needs_numbers() const {
  return std::ranges::any_of(types_, [](Type type) { return bytes_of(type) > 1; });
}

void ColorScale::add(const double* numbers) {
  for (size_t c = 0; c < types_.size(); ++c)
    if (std::isfinite(numbers[c])) largest_[c] = std::max(largest_[c], numbers[c]);
}

void ColorScale::set_full_intensities() {
  for (size_t c = 0; c < types_.size(); ++c) {
    double largest = largest_[c];
    for (size_t k = 0; k < 3 && c < 3; ++k)
      if (types_[k] == types_[c]) largest = std::max(largest, largest_[k]);
    if (bytes_of(types_[c]) == 1)
      full_[c] = 255;
    else if (!is_integer(types_[c]) && largest <= 2)
      full_[c] = 1;
    else
      full_[c] = largest <= 2 * 255 ? 255 : 65535;
  }
}

Color ColorScale::to_color(const double* numbers) const {
  Color color{kFullIntensity, kFullIntensity, kFullIntensity, kFullIntensity};
  for (size_t c = 0; c < types_.size(); ++c) {
    const double number = numbers[c] > 0 ? std::min(numbers[c], full_[c]) : 0;  // 0 for NaN
    color[c] = c == 3 ? intensity_of(number / full_[c]) : light_of(number, full_[c]);
  }
  return color;
}

uint16_t ColorScale::light_of(double number, double full) const {
  if (full == 255) {
    const auto whole = static_cast<size_t>(number);
    if (static_cast<double>(whole) == number) return light_of_byte_[whole];
  }
  return linear_light(number / full);
}

}  // namespace voxdag::ply
