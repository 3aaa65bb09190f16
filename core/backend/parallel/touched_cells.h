// Which cells of a block of N x N x N cubes a triangle touches, all at once: the exact test of
// core/geometry/overlap.h with what the cells have in common computed once.
//
// The block's low corner is `low`, a cell's edge is 2^shift lattice units. With k a cell's position
// in the block, every test asks for the sign of
//
//     g . k * 2^shift + c      for an integer vector g;      2^shift i + c >= 0 <=> i + floor(c /
//                                                            2^shift) >= 0 for an integer i
//
// so that k is only ever multiplied with g. Vertices are odd: their differences are even, and half
// edges and quarter normals are integers.
//
// Bounds, for triangles of at most 2^28 units in each axis and blocks of at most 2^28 units (the
// largest grid): half edges <= 2^27, quarter normals n_a <= 2^55. If triangle and block are not
// apart in an axis, |low - v| <= 2^29 there, so edge constants stay below 2^58. The plane's
// constant needs 128 bits; divided by 2^shift it is clamped to +-2^60, which changes no sign since
// |n . k| + sum |n_a| <= 12 * 2^55 < 2^59. Larger triangles are tested cell by cell.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/base/integers.h"
#include "core/geometry/morton.h"
#include "core/geometry/overlap.h"

namespace voxdag::parallel {

inline constexpr int64_t kNarrowUnits = int64_t{1} << 28;

// Cells are bits in Morton order (N = 2: child index, N = 4: brick bit). The cells whose
// coordinate along `axis` is k.
template <int N>
VOXDAG_HD inline uint64_t cells_at(int axis, int k) {
  const uint64_t low_bit_clear = axis == 2   ? 0x5555555555555555ull
                                 : axis == 1 ? 0x3333333333333333ull
                                             : 0x0f0f0f0f0f0f0f0full;
  const uint64_t high_bit_clear = axis == 2   ? 0x00ff00ff00ff00ffull
                                  : axis == 1 ? 0x0000ffff0000ffffull
                                              : 0x00000000ffffffffull;
  const uint64_t cells =
      (k & 1 ? ~low_bit_clear : low_bit_clear) & (k & 2 ? ~high_bit_clear : high_bit_clear);
  return N == 2 ? cells & 0xff : cells;
}

// Cells that the triangle's bounding box touches, along one axis.
template <int N>
VOXDAG_HD inline uint64_t cells_in_range(int axis, int64_t first, int64_t last) {
  uint64_t cells = 0;
  for (int k = 0; k < N; ++k)
    if (k >= first && k <= last) cells |= cells_at<N>(axis, k);
  return cells;
}

// Cells whose corners do not all lie on one side of the plane through `base` (n . (low - v)).
template <int N>
VOXDAG_HD inline uint64_t cells_at_plane(const int64_t (&n)[3], int128 base, int shift) {
  constexpr int64_t kFar = int64_t{1} << 60;
  const int128 floored = base >> shift;
  const int64_t constant = floored > kFar    ? kFar
                           : floored < -kFar ? -kFar
                                             : static_cast<int64_t>(floored);
  const int64_t remainder = (floored << shift) != base;
  int64_t most = constant, least = constant + remainder;
  for (int a = 0; a < 3; ++a) (n[a] > 0 ? most : least) += n[a];
  uint64_t cells = 0;
  for (int x = 0; x < N; ++x)
    for (int y = 0; y < N; ++y)
      for (int z = 0; z < N; ++z) {
        const int64_t at = n[0] * x + n[1] * y + n[2] * z;
        if (at + most >= 0 && at + least <= 0)
          cells |= cells_at<N>(0, x) & cells_at<N>(1, y) & cells_at<N>(2, z);
      }
  return cells;
}

// Cells with a point where ga a + gb b + constant >= 0, in units of cells along axes a and b.
template <int N>
VOXDAG_HD inline uint64_t cells_inside_edge(int a, int b, int64_t ga, int64_t gb,
                                            int64_t constant) {
  constant += (ga > 0 ? ga : 0) + (gb > 0 ? gb : 0);
  const int64_t span_a = ga * (N - 1), span_b = gb * (N - 1);
  if (constant + (span_a < 0 ? span_a : 0) + (span_b < 0 ? span_b : 0) >= 0) return ~uint64_t{0};
  if (constant + (span_a > 0 ? span_a : 0) + (span_b > 0 ? span_b : 0) < 0) return 0;
  uint64_t cells = 0;
  for (int i = 0; i < N; ++i) {
    uint64_t row = 0;
    for (int j = 0; j < N; ++j)
      if (ga * i + gb * j + constant >= 0) row |= cells_at<N>(b, j);
    cells |= row & cells_at<N>(a, i);
  }
  return cells;
}

// As touched_cells(), one cell after the other: for triangles too large for 64-bit products.
template <int N>
VOXDAG_HD inline uint64_t touched_cells_one_by_one(const FixedTriangle& t, const int64_t (&low)[3],
                                                   int shift) {
  uint64_t cells = 0;
  for (int i = 0; i < N * N * N; ++i) {
    uint32_t k[3];
    morton_decode(static_cast<uint64_t>(i), k[0], k[1], k[2]);
    int64_t cell_low[3];
    for (int a = 0; a < 3; ++a) cell_low[a] = low[a] + (static_cast<int64_t>(k[a]) << shift);
    if (triangle_touches_cube(t, cell_low, int64_t{1} << shift)) cells |= uint64_t{1} << i;
  }
  return cells;
}

template <int N>
VOXDAG_HD inline uint64_t touched_cells(const FixedTriangle& t, const int64_t (&low)[3],
                                        int shift) {
  uint64_t cells = ~uint64_t{0};
  bool narrow = true;
  for (int a = 0; a < 3; ++a) {
    const int64_t from = t.low(a), to = t.high(a);
    cells &= cells_in_range<N>(a, (from - low[a] - 1) >> shift, (to - low[a]) >> shift);
    if (to - from > kNarrowUnits) narrow = false;
  }
  if (cells == 0) return 0;
  if (!narrow) return touched_cells_one_by_one<N>(t, low, shift);

  int64_t half[3][3], n[3];
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) half[i][a] = (t.v[i == 2 ? 0 : i + 1][a] - t.v[i][a]) / 2;
  int128 base = 0;
  for (int a = 0; a < 3; ++a) {
    const int b = a == 2 ? 0 : a + 1, c = a == 0 ? 2 : a - 1;
    n[a] = half[0][b] * half[1][c] - half[0][c] * half[1][b];
    base += static_cast<int128>(n[a]) * (low[a] - t.v[0][a]);
  }
  cells &= cells_at_plane<N>(n, base, shift);
  for (int c = 0; c < 3; ++c) {
    const int a = c == 2 ? 0 : c + 1, b = c == 0 ? 2 : c - 1;
    for (int i = 0; i < 3; ++i) {
      if (cells == 0) return 0;
      const int64_t ga = n[c] < 0 ? half[i][b] : -half[i][b];
      const int64_t gb = n[c] < 0 ? -half[i][a] : half[i][a];
      const int64_t constant = ga * (low[a] - t.v[i][a]) + gb * (low[b] - t.v[i][b]);
      cells &= cells_inside_edge<N>(a, b, ga, gb, constant >> shift);
    }
  }
  return cells;
}

}  // namespace voxdag::parallel
