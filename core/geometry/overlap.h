// The exact test of a closed triangle against a closed axis-aligned cube, both on the fixed-point
// lattice. It is the separating-axis test as arranged in Schwarz and Seidel, "Fast Parallel Surface
// and Solid Voxelization on GPUs" (2010), section 4.1: bounding box, plane, and three edge tests in
// each of the three projections. All arithmetic is in integers, so the test is also exact for
// slivers and degenerate triangles. All faster kernels must give the same result.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/base/integers.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

// The plane test and the edge tests, with products of type `Int`: 64 bits if the cube's edge and
// the triangle's coordinates relative to the cube are below kNarrowReach, 128 bits if below 2^41.
template <class Int>
VOXDAG_HD inline bool triangle_touches_cube_in(const FixedTriangle& t, const int64_t (&low)[3],
                                               int64_t edge) {
  int64_t e[3][3];
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) e[i][a] = t.v[(i + 1) % 3][a] - t.v[i][a];
  Int normal[3];
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    normal[a] = static_cast<Int>(e[0][b]) * e[1][c] - static_cast<Int>(e[0][c]) * e[1][b];
  }

  // Plane test: n.(p - v0) changes sign over the cube's corners p, or is 0 at one of them.
  Int lowest = 0, highest = 0;
  for (int a = 0; a < 3; ++a) {
    const Int near = normal[a] * (low[a] - t.v[0][a]);
    const Int far = normal[a] * (low[a] + edge - t.v[0][a]);
    lowest += near < far ? near : far;
    highest += near < far ? far : near;
  }
  if (lowest > 0 || highest < 0) return false;

  // Edge tests, in the projection along axis c onto (a, b). The edge functions are multiplied by
  // the sign of the normal (+ for 0), so that all three are >= 0 inside the triangle.
  for (int c = 0; c < 3; ++c) {
    const int a = (c + 1) % 3, b = (c + 2) % 3;
    const int64_t sign = normal[c] < 0 ? -1 : 1;
    for (int i = 0; i < 3; ++i) {
      const int64_t na = -e[i][b] * sign, nb = e[i][a] * sign;
      Int value =
          static_cast<Int>(na) * (low[a] - t.v[i][a]) + static_cast<Int>(nb) * (low[b] - t.v[i][b]);
      if (na > 0) value += static_cast<Int>(na) * edge;
      if (nb > 0) value += static_cast<Int>(nb) * edge;
      if (value < 0) return false;
    }
  }
  return true;
}

// Limit of the cube's edge and of the triangle's coordinates relative to the cube. Below this limit
// 64-bit products suffice: edges of the triangle are below 2^20, its normal is below 2^41, and the
// sums of the plane test are below 2^63.
inline constexpr int64_t kNarrowReach = int64_t{1} << 19;

// True if the triangle touches the cube. `low`: the cube's low corner, `edge`: the cube's edge,
// both in lattice units (1/256 voxel). Requires |coordinates| <= 2^40 for triangle and cube.
VOXDAG_HD inline bool triangle_touches_cube(const FixedTriangle& t, const int64_t (&low)[3],
                                            int64_t edge) {
  bool narrow = edge < kNarrowReach;
  for (int a = 0; a < 3; ++a) {
    const int64_t first = t.low(a) - low[a], last = t.high(a) - low[a];
    if (last < 0 || first > edge) return false;
    narrow &= first > -kNarrowReach && last < kNarrowReach;
  }
  return narrow ? triangle_touches_cube_in<int64_t>(t, low, edge)
                : triangle_touches_cube_in<int128>(t, low, edge);
}

}  // namespace voxdag
