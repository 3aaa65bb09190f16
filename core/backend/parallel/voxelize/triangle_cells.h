// Finds the cubes that a triangle touches in a group of N x N x N equal cubes ("cells"), in one
// step. This is the exact test of core/geometry/overlap.h (Schwarz and Seidel 2010, section 4.1).
// Terms that the cells share are computed once.
//
// Let `low` be a corner of the lattice of cells, which are 2^shift units wide, and k the position
// of a cell in this lattice. For an integer vector g and a constant c, every test is the sign of
//
//     g . k * 2^shift + c
//
// For an integer i, 2^shift i + c >= 0 <=> i + floor(c / 2^shift) >= 0. So the tests of cells use
// only the rounded constants and no units within a cell. The coordinates of vertices are odd, so no
// vertex is on the boundary of a cell. Edges are even, so half edges are integers, and so are
// quarter normals, which are cross products of half edges.
//
// The bounds are for triangles of less than 2^28 units in each axis ("narrow") and lattices of at
// most 2^28 units (the largest grid). Half edges are < 2^27. A component of a quarter normal is the
// difference of two products of half edges, so |n_a| < 2^55. If the triangle and the lattice
// overlap in an axis, |low - v| < 2^29 in this axis, so edge constants are below 2^58. The
// constants of the plane need 128 bits. The constants are clamped to fewer bits. A clamped constant
// still decides the sign of a test if its magnitude exceeds the sum of the terms that are added to
// it. With N = 4, this sum is below 2^30 for edges (less than 8 half edges), and at most 12 max
// |n_a| for the plane. Larger triangles are tested cell by cell.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/base/integers.h"
#include "core/geometry/morton.h"
#include "core/geometry/overlap.h"

namespace voxdag::parallel {

inline constexpr int64_t kNarrowUnits = int64_t{1} << 28;

// Returns the part of a cell's bit number for coordinate k along `axis`. The bit number, in Morton
// order (N = 2: child index, N = 4: brick bit), is the sum of the three parts.
VOXDAG_HD constexpr int cell_bit(int axis, int k) { return ((k & 1) | (k & 2) << 2) << (2 - axis); }

// Returns `cells`, which have the coordinate 0 along `axis`, together with their copies at all
// other coordinates along `axis`.
template <int N>
VOXDAG_HD inline uint64_t repeat_along(int axis, uint64_t cells) {
  cells |= cells << cell_bit(axis, 1);
  return N == 2 ? cells : cells | cells << cell_bit(axis, 2);
}

template <class Int>
VOXDAG_HD inline Int clamp_to(int128 x, Int bound) {
  return x > bound ? bound : x < -bound ? static_cast<Int>(-bound) : static_cast<Int>(x);
}

// A narrow triangle, prepared for tests on a lattice of cells. The first cell has its low corner at
// `low`, and a cell's edge is 2^shift lattice units.
struct TriangleOnLattice {
  // An edge in the projection along one axis. A cell with coordinates p and q along the next two
  // axes (modulo 3) touches the inner side of the edge iff a p + b q + constant >= 0.
  struct Edge {
    int32_t a, b;
    int64_t constant;
  };
  int32_t first[3], last[3];  // range of the cells in the bounding box
  int64_t n[3];               // quarter normal
  int128 plane;               // n . (low - v) / 2^shift, floored; v is vertex 0
  int32_t remainder;          // 1 if the division for `plane` left a remainder
  bool short_normal;          // the plane test needs only 32 bits
  Edge edges[3][3];           // [projection][edge]

  VOXDAG_HD TriangleOnLattice(const FixedTriangle& t, const int64_t (&low)[3], int shift) {
    int64_t half[3][3];
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 3; ++a) half[i][a] = (t.v[i == 2 ? 0 : i + 1][a] - t.v[i][a]) / 2;
    int128 base = 0;
    short_normal = true;
    for (int a = 0; a < 3; ++a) {
      first[a] = static_cast<int32_t>((t.low(a) - low[a]) >> shift);
      last[a] = static_cast<int32_t>((t.high(a) - low[a]) >> shift);
      const int b = a == 2 ? 0 : a + 1, c = a == 0 ? 2 : a - 1;
      n[a] = half[0][b] * half[1][c] - half[0][c] * half[1][b];
      base += static_cast<int128>(n[a]) * (low[a] - t.v[0][a]);
      if (n[a] > kShortNormal || n[a] < -kShortNormal) short_normal = false;
    }
    plane = base >> shift;
    remainder = (plane << shift) != base;
    for (int c = 0; c < 3; ++c) {
      const int a = c == 2 ? 0 : c + 1, b = c == 0 ? 2 : c - 1;
      for (int i = 0; i < 3; ++i) {
        const int64_t ga = n[c] < 0 ? half[i][b] : -half[i][b];
        const int64_t gb = n[c] < 0 ? -half[i][a] : half[i][a];
        const int64_t constant = ga * (low[a] - t.v[i][a]) + gb * (low[b] - t.v[i][b]);
        edges[c][i] = {static_cast<int32_t>(ga), static_cast<int32_t>(gb),
                       (constant >> shift) + (ga > 0 ? ga : 0) + (gb > 0 ? gb : 0)};
      }
    }
  }

  // Returns the cells that the triangle touches, in the group whose first cell has position `at` in
  // the lattice. Cells are bits numbered by cell_bit().
  template <int N>
  VOXDAG_HD uint64_t touched(const int (&at)[3]) const {
    uint64_t cells = ~uint64_t{0};
    for (int a = 0; a < 3; ++a) cells &= in_box<N>(a, first[a] - at[a], last[a] - at[a]);
    if (cells == 0) return 0;
    cells &= short_normal ? at_plane<N>(at, kFar32) : at_plane<N>(at, kFar64);
    for (int c = 0; c < 3 && cells != 0; ++c) cells &= inside_edges<N>(c, at);
    return cells;
  }

 private:
  static constexpr int64_t kShortNormal = int64_t{1} << 26;
  static constexpr int32_t kFar32 = (int32_t{1} << 30) - 1;
  static constexpr int64_t kFar64 = int64_t{1} << 60;

  template <int N>
  VOXDAG_HD static uint64_t in_box(int axis, int from, int to) {
    uint64_t cells = 0;
    for (int k = 0; k < N; ++k)
      if (k >= from && k <= to) cells |= uint64_t{1} << cell_bit(axis, k);
    cells = repeat_along<N>(axis == 0 ? 1 : 0, cells);
    return repeat_along<N>(axis == 2 ? 1 : 2, cells);
  }

  // Returns the cells of the group at `at` that the plane touches: cells with corners on both sides
  // of the plane, or on it. The plane's value is clamped to [-far, far].
  template <int N, class Int>
  VOXDAG_HD uint64_t at_plane(const int (&at)[3], Int far) const {
    int128 here = plane;
    for (int a = 0; a < 3; ++a) here += static_cast<int128>(n[a]) * at[a];
    Int most = clamp_to<Int>(here, far), least = most + static_cast<Int>(remainder), step[3];
    for (int a = 0; a < 3; ++a) {
      step[a] = static_cast<Int>(n[a]);
      (step[a] > 0 ? most : least) += step[a];
    }
    uint64_t cells = 0;
    for (int x = 0; x < N; ++x)
      for (int y = 0; y < N; ++y)
        for (int z = 0; z < N; ++z) {
          const Int value = step[0] * x + step[1] * y + step[2] * z;
          const bool meets = value + most >= 0 && value + least <= 0;
          cells |= uint64_t{meets} << (cell_bit(0, x) + cell_bit(1, y) + cell_bit(2, z));
        }
    return cells;
  }

  // Returns the cells of the group at `at` that touch the inner sides of all three edges, in the
  // projection along axis c.
  template <int N>
  VOXDAG_HD uint64_t inside_edges(int c, const int (&at)[3]) const {
    const int a = c == 2 ? 0 : c + 1, b = c == 0 ? 2 : c - 1;
    uint64_t cells = ~uint64_t{0};
    for (int i = 0; i < 3; ++i) {
      const Edge& edge = edges[c][i];
      const int64_t here = edge.constant + int64_t{edge.a} * at[a] + int64_t{edge.b} * at[b];
      const int32_t constant = clamp_to<int32_t>(here, kFar32);
      const int32_t span_a = edge.a * (N - 1), span_b = edge.b * (N - 1);
      if (constant + (span_a < 0 ? span_a : 0) + (span_b < 0 ? span_b : 0) >= 0) continue;
      if (constant + (span_a > 0 ? span_a : 0) + (span_b > 0 ? span_b : 0) < 0) return 0;
      uint64_t inside = 0;
      for (int p = 0; p < N; ++p)
        for (int q = 0; q < N; ++q)
          inside |= uint64_t{edge.a * p + edge.b * q + constant >= 0}
                    << (cell_bit(a, p) + cell_bit(b, q));
      cells &= inside;
    }
    return cells == ~uint64_t{0} ? cells : repeat_along<N>(c, cells);
  }
};

// Like touched_cells(), but cell by cell, for triangles too large for 64-bit products.
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

// Returns false if the triangle's bounding box misses the cube with the low corner `low` and an
// edge of 2^shift lattice units.
VOXDAG_HD inline bool box_touches_cube(const FixedTriangle& t, const int64_t (&low)[3], int shift) {
  for (int a = 0; a < 3; ++a)
    if (t.high(a) < low[a] || t.low(a) > low[a] + (int64_t{1} << shift)) return false;
  return true;
}

VOXDAG_HD inline bool is_narrow(const FixedTriangle& t) {
  for (int a = 0; a < 3; ++a)
    if (t.high(a) - t.low(a) >= kNarrowUnits) return false;
  return true;
}

// Returns the cells that the triangle touches, as bits numbered by cell_bit(), in a group of
// N x N x N cells. A cell has an edge of 2^shift lattice units. The low corner of the first cell is
// `low`.
template <int N>
VOXDAG_HD inline uint64_t touched_cells(const FixedTriangle& t, const int64_t (&low)[3],
                                        int shift) {
  if (!box_touches_cube(t, low, shift + (N == 2 ? 1 : 2))) return 0;
  if (!is_narrow(t)) return touched_cells_one_by_one<N>(t, low, shift);
  return TriangleOnLattice(t, low, shift).touched<N>({0, 0, 0});
}

}  // namespace voxdag::parallel
