#include "core/backend/cpu/memo/plane.h"

#include <algorithm>
#include <cstdlib>
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

void Plane::set_rule(VoxelRule rule) {
  const int64_t size = rising() - falling();
  if (rule == VoxelRule::kThin) {
    int dominant = 0;
    for (int a = 1; a < 3; ++a)
      if (std::abs(n[a]) > std::abs(n[dominant])) dominant = a;
    for (int a = 0; a < 3; ++a)
      if (a != dominant) c += static_cast<int128>(n[a]) * (kUnitsPerVoxel / 2);
    if ((n[0] != 0 ? n[0] : n[1] != 0 ? n[1] : n[2]) < 0) c -= 1;
    fractional = true;
    up = std::max<int64_t>(n[dominant], 0);
    width = std::abs(n[dominant]) - 1;
    return;
  }
  // Let x be the corners of the voxel with the low corner k. The maximum of n.x + f is n.k + f +
  // rising(), and the minimum is the maximum minus `size`. The plane touches the voxel if the
  // maximum is >= 0 and the minimum <= 0. If `fractional`, the exact value at each corner is
  // greater than n.x + f by less than 1, so the minimum must be <= -1.
  fractional = (c & (kUnitsPerVoxel - 1)) != 0;
  up = rising();
  width = size - (fractional ? 1 : 0);
}

bool Plane::crosses(int64_t f, int size_log2) const {
  const int64_t last = (int64_t{1} << size_log2) - 1;
  return f + up + last * rising() >= 0 && f + up + last * falling() <= width;
}

bool Plane::is_below(int64_t f, int size_log2) const {
  const int64_t last = (int64_t{1} << size_log2) - 1;
  return f + up + last * falling() > width;
}

bool Plane::offset_from(const LatticeCube& cube, int size_log2, int64_t& f) const {
  int128 at_corner = c;
  for (int a = 0; a < 3; ++a) at_corner += static_cast<int128>(n[a]) * cube.low[a];
  const int128 floored = at_corner >> kUnitBits;
  const int128 last = (int128{1} << size_log2) - 1;
  if (floored + up + last * rising() < 0 || floored + up + last * falling() > width) return false;
  f = static_cast<int64_t>(floored);
  return true;
}

Plane plane_of(const NarrowTriangle& t, VoxelRule rule) {
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
  plane.set_rule(rule);
  return plane;
}

}  // namespace voxdag::cpu
