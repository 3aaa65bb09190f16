// Low-discrepancy sample points that depend only on the pixel and the sample's number. So a picture
// is the same for any number of threads.
#pragma once

#include "core/base/integers.h"
#include "query/dag/vec.h"

namespace voxdag::query {

inline constexpr double kPi = 3.14159265358979323846;

// Points in [0, 1)^2 that cover the square evenly (the R2 sequence). A sample of a pixel needs
// points for several purposes, such as its position in the pixel and its rays to the sky. Each
// purpose is a dimension; a dimension shifts the sequence by a random amount. The sequences of
// neighboring pixels start far apart, so the remaining noise is fine-grained.
class Sampler {
 public:
  struct Pair {
    double u, v;
  };

  explicit Sampler(uint64_t seed) : start_{random(seed, 0), random(seed, 1)} {}
  Sampler(int x, int y, int sample)
      : start_{x * 0.7548776662466927 + y * 0.5698402909980532,
               x * 0.4142135623730951 + y * 0.7320508075688772},
        sample_(sample) {}

  // Returns point `i` of this sample. `count` is the number of points that each sample of the pixel
  // uses in this dimension.
  Pair pair(uint64_t dimension, int i = 0, int count = 1) const {
    const double n = static_cast<double>(sample_) * count + i;
    return {wrap(start_[0] + random(dimension, 0) + 0.7548776662466927 * n),
            wrap(start_[1] + random(dimension, 1) + 0.5698402909980532 * n)};
  }

 private:
  static double wrap(double x) { return x - std::floor(x); }
  static double random(uint64_t which, uint64_t axis) {
    return static_cast<double>(mix_bits((2 * which + axis + 1) * 0x9e3779b97f4a7c15ull) >> 11) *
           0x1p-53;
  }

  double start_[2];
  int sample_ = 0;
};

// Converts a point of a Sampler to a direction around the unit vector `n`, with a density
// proportional to the cosine of the angle to `n`.
inline Vec cosine_direction(const Vec& n, const Sampler::Pair& p) {
  Vec a, b;
  basis_around(n, a, b);
  const double r = std::sqrt(p.u), angle = 2 * kPi * p.v;
  return a * (r * std::cos(angle)) + b * (r * std::sin(angle)) + n * std::sqrt(1 - p.u);
}

}  // namespace voxdag::query
