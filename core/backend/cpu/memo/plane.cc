#include "core/backend/cpu/memo/plane.h"

#include <numeric>

namespace voxdag::cpu {

int64_t Plane::rising() const {
  int64_t sum = 0;
  for (const int64_t x : n) sum += x > 0 ? x : 0;
  return sum;
}

int64_t Plane::falling() const {
  int64_t sum = 0;
  for (const int64_t x : n) sum += x < 0 ? x : 0;
  return sum;
}

bool Plane::fits(int size_log2) const {
  return rising() - falling() <= (int64_t{1} << 61) >> size_log2;
}

bool Plane::crosses(int64_t f, int size_log2) const {
  const int64_t size = int64_t{1} << size_log2;
  return f + size * rising() >= 0 && f + size * falling() + (fractional ? 1 : 0) <= 0;
}

bool Plane::offset_from(const LatticeCube& cube, int size_log2, int64_t& f) const {
  int128 at_corner = c;
  for (int a = 0; a < 3; ++a) at_corner += static_cast<int128>(n[a]) * cube.low[a];
  const int128 floored = at_corner >> kUnitBits;
  const int128 highest = floored + (static_cast<int128>(rising()) << size_log2);
  const int128 lowest = floored + (static_cast<int128>(falling()) << size_log2);
  if (highest < 0 || lowest + (fractional ? 1 : 0) > 0) return false;
  f = static_cast<int64_t>(floored);
  return true;
}

Plane plane_of(const NarrowTriangle& t) {
  int64_t half[3][2];
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 2; ++i) half[a][i] = (int64_t{t.v[a][i + 1]} - t.v[a][i]) / 2;
  Plane plane;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    plane.n[a] = half[b][0] * half[c][1] - half[c][0] * half[b][1];
  }
  const int64_t divisor = std::gcd(std::gcd(plane.n[0], plane.n[1]), plane.n[2]);
  plane.c = 0;
  for (int a = 0; a < 3; ++a) {
    plane.n[a] /= divisor;
    plane.c -= static_cast<int128>(plane.n[a]) * t.v[a][0];
  }
  plane.fractional = (plane.c & (kUnitsPerVoxel - 1)) != 0;
  return plane;
}

}  // namespace voxdag::cpu
