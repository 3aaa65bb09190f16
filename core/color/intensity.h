// Arithmetic of intensities: integers from 0 to 65535, which stands for 1.0.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag::color {

// Returns a b / 65535, rounded to nearest: the product of two intensities.
VOXDAG_HD inline uint32_t scaled(uint32_t a, uint32_t b) {
  const uint32_t product = a * b + 32768;
  return (product + (product >> 16)) >> 16;
}

}  // namespace voxdag::color
