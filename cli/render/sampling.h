// Numbers that look random but are the same in every run: pictures do not depend on threads.
#pragma once

#include <cstdint>

#include "cli/render/vec.h"

namespace voxdag::render {

class Sampler {
 public:
  explicit Sampler(uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15ull + 0x2545f4914f6cdd1dull) {}
  // In [0, 1).
  double next() {
    state_ += 0x9e3779b97f4a7c15ull;
    uint64_t x = state_;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return static_cast<double>((x ^ x >> 31) >> 11) * 0x1p-53;
  }
  Vec direction() {
    const double y = 2 * next() - 1, angle = 2 * kPi * next(), r = std::sqrt(1 - y * y);
    return {{r * std::cos(angle), y, r * std::sin(angle)}};
  }

  static constexpr double kPi = 3.14159265358979323846;

 private:
  uint64_t state_;
};

// A direction about the unit vector `n`, more often near it, as a matt surface gathers light.
// u and v in [0, 1).
inline Vec cosine_direction(const Vec& n, double u, double v) {
  Vec a, b;
  basis_around(n, a, b);
  const double r = std::sqrt(u), angle = 2 * Sampler::kPi * v;
  return a * (r * std::cos(angle)) + b * (r * std::sin(angle)) + n * std::sqrt(1 - u);
}

}  // namespace voxdag::render
