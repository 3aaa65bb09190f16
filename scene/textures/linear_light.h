// Converts sRGB (IEC 61966-2-1) to linear light in 16 bits, with the same result on every machine.
// Uses IEEE + - * / and a fifth root by Newton's method.
#pragma once

#include <cmath>
#include <cstdint>

namespace voxdag {

// Returns the linear light of an sRGB channel, from 0 to 65535, rounded to nearest. `encoded` is
// from 0 to 1.
inline uint16_t linear_light(double encoded) {
  double linear = encoded / 12.92;
  if (encoded > 0.04045) {
    const double x = (encoded + 0.055) / 1.055, square = x * x;
    double root = 1;  // fifth root of `square`
    for (int i = 0; i < 24; ++i) {
      const double fourth = (root * root) * (root * root);
      root = (4 * root + square / fourth) / 5;
    }
    linear = square * root;  // x^2.4 = x^2 * (x^2)^(1/5)
  }
  return static_cast<uint16_t>(std::floor(linear * 65535 + 0.5));
}

}  // namespace voxdag
