// Numbers that look random but are the same in every run: a picture does not depend on threads.
#pragma once

#include <cstdint>

#include "cli/render/vec.h"

namespace voxdag::render {

// For one sample of a pixel. Each pixel has its own random offsets; its samples are spread evenly
// from there (the R2 sequence), so that few of them already cover each pair of numbers well.
class Sampler {
 public:
  explicit Sampler(uint64_t pixel, uint64_t sample = 0) : state_(pixel), sample_(sample) {}

  // Two numbers in [0, 1): member `i` of `count` that this sample may ask for together.
  struct Pair {
    double u, v;
  };
  Pair pair(uint64_t i, uint64_t count) const {
    const auto n = static_cast<double>(sample_ * count + i);
    return {wrap(offset(0) + 0.7548776662466927 * n), wrap(offset(1) + 0.5698402909980532 * n)};
  }
  // Other numbers from here on.
  void next_pair() { state_ += 2; }
  // A pair that is not part of a set.
  Pair pair() {
    const Pair p = pair(0, 1);
    next_pair();
    return p;
  }

 private:
  static double wrap(double x) { return x - std::floor(x); }
  double offset(uint64_t which) const {
    uint64_t x = (state_ + which + 1) * 0x9e3779b97f4a7c15ull;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return static_cast<double>((x ^ x >> 31) >> 11) * 0x1p-53;
  }

  uint64_t state_;
  const uint64_t sample_;
};

inline constexpr double kPi = 3.14159265358979323846;

// Any direction as likely as any other.
inline Vec uniform_direction(const Sampler::Pair& p) {
  const double y = 2 * p.u - 1, angle = 2 * kPi * p.v, r = std::sqrt(1 - y * y);
  return {{r * std::cos(angle), y, r * std::sin(angle)}};
}

// A direction about the unit vector `n`, more often near it, as a matt surface gathers light.
inline Vec cosine_direction(const Vec& n, const Sampler::Pair& p) {
  Vec a, b;
  basis_around(n, a, b);
  const double r = std::sqrt(p.u), angle = 2 * kPi * p.v;
  return a * (r * std::cos(angle)) + b * (r * std::sin(angle)) + n * std::sqrt(1 - p.u);
}

}  // namespace voxdag::render
