// Numbers that look random but are the same in every run: a picture does not depend on threads.
#pragma once

#include <cstdint>

#include "query/vec.h"

namespace voxdag::query {

// Pairs of numbers in [0, 1) that cover the unit square evenly (the R2 sequence). The sequences of
// neighboring pixels start far from one another, so that what noise is left is fine-grained.
class Sampler {
 public:
  struct Pair {
    double u, v;
  };

  explicit Sampler(uint64_t seed) : start_{random(seed, 0), random(seed, 1)} {}
  // Sample `sample` of a pixel.
  Sampler(int x, int y, int sample)
      : start_{x * 0.7548776662466927 + y * 0.5698402909980532,
               x * 0.4142135623730951 + y * 0.7320508075688772},
        sample_(sample) {}

  // Member `i` of `count` pairs that this sample asks for together.
  Pair pair(int i, int count) const {
    const double n = static_cast<double>(sample_) * count + i;
    return {wrap(start_[0] + random(question_, 0) + 0.7548776662466927 * n),
            wrap(start_[1] + random(question_, 1) + 0.5698402909980532 * n)};
  }
  // The pairs from here on have nothing to do with those before.
  void next_question() { ++question_; }
  Pair pair() {
    const Pair p = pair(0, 1);
    next_question();
    return p;
  }

 private:
  static double wrap(double x) { return x - std::floor(x); }
  static double random(uint64_t which, uint64_t axis) {
    uint64_t x = (2 * which + axis + 1) * 0x9e3779b97f4a7c15ull;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return static_cast<double>((x ^ x >> 31) >> 11) * 0x1p-53;
  }

  double start_[2];
  int sample_ = 0;
  uint64_t question_ = 0;
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

}  // namespace voxdag::query
