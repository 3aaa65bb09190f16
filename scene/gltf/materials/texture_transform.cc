#include "scene/gltf/materials/texture_transform.h"

#include <cmath>

namespace voxdag::gltf {
namespace {

// Pi / 2 in two parts. The first has 33 bits, so that its products with small integers are exact.
constexpr double kHalfPiHigh = 0x1.921fb544p+0;
constexpr double kHalfPiLow = 0x1.0b4611a626331p-34;
constexpr double kTwoPi = 0x1.921fb54442d18p+2;

// Returns sin(x) by its Taylor series, for |x| up to pi / 4. The first omitted term is below 2^-52.
double sine_near_zero(double x) {
  const double y = x * x;
  double sum = 0;
  for (int n = 17; n >= 3; n -= 2) sum = (1 + sum) * (-y / (n * (n - 1)));
  return x + x * sum;
}
double cosine_near_zero(double x) {
  const double y = x * x;
  double sum = 0;
  for (int n = 18; n >= 2; n -= 2) sum = (1 + sum) * (-y / (n * (n - 1)));
  return 1 + sum;
}

}  // namespace

SineCosine sine_and_cosine(double angle) {
  if (!(angle - angle == 0)) return {};
  const double reduced = std::fmod(angle, kTwoPi);
  const double quarters = std::floor(reduced / (kHalfPiHigh + kHalfPiLow) + 0.5);
  const double rest = (reduced - quarters * kHalfPiHigh) - quarters * kHalfPiLow;
  const double s = sine_near_zero(rest), c = cosine_near_zero(rest);
  switch (static_cast<int>(quarters) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

TextureTransform make_texture_transform(const std::array<double, 2>& offset, double rotation,
                                        const std::array<double, 2>& scale) {
  const auto [s, c] = sine_and_cosine(rotation);
  TextureTransform out;
  out.m[0][0] = c * scale[0];
  out.m[0][1] = s * scale[1];
  out.m[0][2] = offset[0];
  out.m[1][0] = -s * scale[0];
  out.m[1][1] = c * scale[1];
  out.m[1][2] = offset[1];
  return out;
}

}  // namespace voxdag::gltf
