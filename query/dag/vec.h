// Points and directions in voxels. The grid is the cube [0, R]^3, where R is its resolution. y is
// up.
#pragma once

#include <cmath>

namespace voxdag::query {

struct Vec {
  double v[3] = {0, 0, 0};
  double operator[](int axis) const { return v[axis]; }
  double& operator[](int axis) { return v[axis]; }
};

inline Vec operator+(const Vec& a, const Vec& b) {
  return {{a[0] + b[0], a[1] + b[1], a[2] + b[2]}};
}
inline Vec operator-(const Vec& a, const Vec& b) {
  return {{a[0] - b[0], a[1] - b[1], a[2] - b[2]}};
}
inline Vec operator*(const Vec& a, double s) { return {{a[0] * s, a[1] * s, a[2] * s}}; }
inline double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}};
}
inline double length(const Vec& a) { return std::sqrt(dot(a, a)); }
inline Vec normalized(const Vec& a) { return a * (1 / length(a)); }
inline Vec mix(const Vec& a, const Vec& b, double t) { return a + (b - a) * t; }

struct Ray {
  Vec origin;
  Vec direction;  // of length 1
  Vec at(double t) const { return origin + direction * t; }
};

// Sets `u` and `w` so that they form an orthonormal basis with the unit vector `n`.
inline void basis_around(const Vec& n, Vec& u, Vec& w) {
  u = normalized(cross(n, std::fabs(n[1]) < 0.9 ? Vec{{0, 1, 0}} : Vec{{1, 0, 0}}));
  w = cross(n, u);
}

}  // namespace voxdag::query
