#include "scene/polygon/projection.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace voxdag::polygon {
namespace {

using Vector = std::array<double, 3>;

Vector difference(const double* a, const double* b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Vector cross(const Vector& p, const Vector& q) {
  return {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
}
double length_1(const Vector& v) { return (std::fabs(v[0]) + std::fabs(v[1])) + std::fabs(v[2]); }

// Returns the maximum rounding error of normalized coordinates: half a unit in the last place of 1,
// in float precision if all coordinates are floats and otherwise in double precision.
double rounding_of(std::span<const double> xyz) {
  const bool are_floats = std::ranges::all_of(
      xyz, [](double c) { return static_cast<double>(static_cast<float>(c)) == c; });
  return are_floats ? 0x1p-25 : 0x1p-54;
}

// Sums over the triangles of a fan, in one coordinate plane.
struct FanInPlane {
  double area = 0, absolute_area = 0;
  bool has_left = false, has_right = false;  // counterclockwise and clockwise triangles

  void add(double twice_area, double tolerance) {
    area += twice_area;
    absolute_area += std::fabs(twice_area);
    has_left |= twice_area > tolerance;
    has_right |= twice_area < -tolerance;
  }
};

}  // namespace

bool is_clear_fan(std::span<const double> xyz) {
  Vector sum{}, low{}, high{};  // sum of magnitudes, minimum and maximum of the areas
  Vector q = difference(&xyz[3], &xyz[0]);
  for (size_t k = 2; 3 * k < xyz.size(); ++k) {
    const Vector p = q;
    q = difference(&xyz[3 * k], &xyz[0]);
    const Vector twice_area = cross(p, q);
    for (size_t a = 0; a < 3; ++a) {
      sum[a] += std::fabs(twice_area[a]);
      low[a] = std::min(low[a], twice_area[a]);
      high[a] = std::max(high[a], twice_area[a]);
    }
  }
  size_t best = 0;
  for (size_t a = 1; a < 3; ++a)
    if (sum[a] > sum[best]) best = a;
  // Outside of this range, products may have been rounded to 0 or infinity.
  const bool is_in_range = sum[best] > 0x1p-800 && sum[best] < 0x1p1000;
  return is_in_range && (low[best] >= 0 || high[best] <= 0);
}

bool normalize(std::span<double> xyz) {
  double largest = 0, sum = 0;
  for (const double c : xyz) {
    largest = std::max(largest, std::fabs(c));
    sum += c - c;  // NaN if a coordinate is not finite
  }
  if (sum != 0) return false;
  int exponent;
  std::frexp(largest, &exponent);
  // Multiplies in two steps, because 2^-exponent may be too large for a double.
  const double factor = std::ldexp(1.0, -exponent / 2);
  const double rest = std::ldexp(1.0, -exponent - -exponent / 2);
  if (exponent != 0)
    for (double& c : xyz) c = c * factor * rest;
  return true;
}

Projection choose_projection(std::span<const double> xyz) {
  const double rounding = rounding_of(xyz);
  std::array<FanInPlane, 3> planes;
  Vector q = difference(&xyz[3], &xyz[0]);
  for (size_t k = 2; 3 * k < xyz.size(); ++k) {
    const Vector p = q;
    q = difference(&xyz[3 * k], &xyz[0]);
    const Vector twice_area = cross(p, q);
    // The coordinates of p and q are differences, so their errors are at most 2 * rounding.
    const double tolerance = 2 * rounding * (length_1(p) + length_1(q));
    for (size_t a = 0; a < 3; ++a) planes[a].add(twice_area[a], tolerance);
  }
  size_t best = 0;
  for (size_t a = 1; a < 3; ++a)
    if (planes[a].absolute_area > planes[best].absolute_area) best = a;
  const FanInPlane& plane = planes[best];
  const bool is_mirrored = plane.area < 0;
  return {static_cast<int>(best), is_mirrored, !(is_mirrored ? plane.has_left : plane.has_right)};
}

void project(std::span<const double> xyz, const Projection& projection, std::vector<Point>& out) {
  auto first = static_cast<size_t>((projection.axis + 1) % 3);
  auto second = static_cast<size_t>((projection.axis + 2) % 3);
  if (projection.is_mirrored) std::swap(first, second);
  out.resize(xyz.size() / 3);
  for (size_t i = 0; i < out.size(); ++i) out[i] = {xyz[3 * i + first], xyz[3 * i + second]};
}

}  // namespace voxdag::polygon
