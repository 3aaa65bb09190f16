// Converts the numbers of scene files to the integers of surfaces. Uses only IEEE + - * and floor,
// so that all machines get the same integers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/color/surface.h"

namespace voxdag {

// Converts a texture coordinate, in units of the image's width or height, to the units of
// SurfaceCorner::texture. Rounds to nearest, and clamps to a magnitude of 2^40. Returns 0 for NaN.
inline int64_t texture_lattice(double coordinate) {
  constexpr double kOne = int64_t{1} << kTextureBits;
  constexpr double kLimit = int64_t{1} << 40;
  if (coordinate != coordinate) return 0;
  return static_cast<int64_t>(std::clamp(std::floor(coordinate * kOne + 0.5), -kLimit, kLimit));
}

// Converts a value from 0 to 1 to a number from 0 to kFullIntensity, rounded to nearest. Clamps
// other values. Returns 0 for NaN.
inline uint16_t intensity_of(double value) {
  if (!(value > 0)) return 0;
  return static_cast<uint16_t>(std::floor(std::min(value, 1.0) * kFullIntensity + 0.5));
}

}  // namespace voxdag
