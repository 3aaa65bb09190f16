// A triangle prepared for the cells of the color grid: exact integer tests of touching
// (core/geometry/overlap.h) and of covering columns (docs/color.md).
//
// Here, axes 0, 1, 2 are a cyclic permutation of x, y, z. Axis 2 is the dominant axis: the normal's
// component along it is the largest, and is made positive (n_2 > 0, and |n_0|, |n_1| <= n_2).
//
//     axis 1
//     | . . . .      A cell has 16 columns along axis 2, at 1/8, 3/8, 5/8 and 7/8 of its edge E.
//     | . . . .      Column (P, Q) of the grid is at ((2 P + 1) E/8, (2 Q + 1) E/8), so cell (p, q)
//     | . . . .      has the columns 4p..4p+3 x 4q..4q+3. "Quarters" are units of E/4.
//     | . . . .
//     +--------- axis 0
//
// A triangle covers a column of a cell if the column, which is a line, crosses the triangle within
// the closed cell.
//
// Every test computes the sign of a linear function at a cell or column. The function has integer
// coefficients. Divided by E (for cells) or E/4 (for columns), it is A p + B q + C. A and B are
// integers. C can be a fraction, and is rounded down or up to an integer. The rounding does not
// change the sign.
//
// Bounds. Int is int64_t for triangles in the narrow box: coordinates v with 0 <= v + 2^27 < 2^29
// (coordinates in the grid are at most 2^28). There, edges are below 2^29 and normals at most 2^58.
// Edge functions are below 2^59 anywhere in the box, and at most 2^62 when added over 16 columns
// inside the triangle. If the plane touches a cell, the plane's function in quarters is below 10
// n_2 < 2^62 at the cell's columns. Other intermediate values wrap around. Int is int128 for all
// other triangles. Their coordinates are at most 2^40 and their normals at most 2^82, so the
// product n.v is below 2^124.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/base/host_device.h"
#include "core/base/integers.h"
#include "core/color/rule/exact.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag::color {

VOXDAG_HD inline bool is_narrow(const FixedTriangle& t) {
  constexpr int64_t kLow = int64_t{1} << 27;
  uint64_t bits = 0;
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) bits |= static_cast<uint64_t>(t.v[i][a] + kLow);
  return bits >> 29 == 0;
}

template <class Int>
VOXDAG_HD inline void normal_of(const FixedTriangle& t, Int (&n)[3]) {
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    n[a] = static_cast<Int>(t.v[1][b] - t.v[0][b]) * (t.v[2][c] - t.v[1][c]) -
           static_cast<Int>(t.v[1][c] - t.v[0][c]) * (t.v[2][b] - t.v[1][b]);
  }
}

// Returns the length of n. The squares of its components are added in the order x, y, z, because
// the order determines the rounding. If only one component is not 0, the length is exactly this
// component's magnitude (as a double), because IEEE 754 square roots are correctly rounded.
template <class Int>
VOXDAG_HD inline double length_of(const Int (&n)[3]) {
  const double x = to_double(n[0]), y = to_double(n[1]), z = to_double(n[2]);
  return std::sqrt(x * x + y * y + z * z);
}

// Returns twice the triangle's area, in square lattice units.
VOXDAG_HD inline double area_of(const FixedTriangle& triangle) {
  if (is_narrow(triangle)) {
    int64_t n[3];
    normal_of(triangle, n);
    return length_of(n);
  }
  int128 n[3];
  normal_of(triangle, n);
  return length_of(n);
}

template <class Int>
struct CellTriangle {
  // The function of an edge in a projection: a x + b y + base. The coordinates x and y are in
  // lattice units. The function is >= 0 inside the triangle.
  struct Edge {
    Int a, b, base;
    // The maximum of the function over the closed cell (p, q) is >= 0 iff a p + b q + touch >= 0.
    Int touch;
  };

  int axis[3];
  int cell_bits;    // log2 of the cell's edge E in lattice units (1/256 voxel)
  int64_t v[3][3];  // [vertex][permuted axis]
  Int normal[3];    // all 0 if the triangle is degenerate
  double slope[2];  // rise along axis 2 per unit of axes 0 and 1; only for estimates
  bool degenerate;
  double area;  // twice the area in square lattice units: the length of the normal
  // The function of the triangle's plane is normal.x - normal.v, for a point x and any vertex v.
  // The function is 0 on the plane. plane_floor and plane_ceil are the function's value at the
  // grid's origin, divided by the cell's edge E = 2^cell_bits and rounded down and up. column_floor
  // and column_ceil are its value at the point of column (0, 0) with the coordinate 0 along axis 2,
  // divided by E/4 and rounded down and up. The comment at the top of this file defines column (0,
  // 0).
  Int plane_floor, plane_ceil, column_floor, column_ceil;
  // edges[d][i] is the edge from vertex i to i + 1 in the projection along axis d. In its function,
  // x and y are along the axes d + 1 and d + 2. (All sums are modulo 3.)
  Edge edges[3][3];
  // In the projection along axis 2, the function of edge i at column (P, Q) is
  // 2^(cell_bits - 2) (a P + b Q) + at_column[i], which is >= 0 iff a P + b Q + column[i] >= 0.
  Int at_column[3], column[3];

  VOXDAG_HD CellTriangle(const FixedTriangle& triangle, int bits) : cell_bits(bits) {
    Int n[3];
    normal_of(triangle, n);
    int dominant = magnitude(n[1]) > magnitude(n[0]) ? 1 : 0;
    if (magnitude(n[2]) > magnitude(n[dominant])) dominant = 2;
    degenerate = n[dominant] == 0;
    area = length_of(n);
    const Int sign = n[dominant] < 0 ? -1 : 1;
    for (int d = 0; d < 3; ++d) {
      axis[d] = (dominant + 1 + d) % 3;
      normal[d] = sign * n[axis[d]];
      for (int i = 0; i < 3; ++i) v[i][d] = triangle.v[i][axis[d]];
    }
    set_edges(2, sign);
    set_edges(0, sign);
    set_edges(1, sign);
    if (!degenerate) set_plane();
  }

 private:
  VOXDAG_HD void set_edges(int d, Int orientation) {
    const int x = (d + 1) % 3, y = (d + 2) % 3;
    const Int sign = normal[d] < 0 ? -orientation : orientation;
    for (int i = 0; i < 3; ++i) {
      const int j = i == 2 ? 0 : i + 1;
      Edge& e = edges[d][i];
      e.a = -sign * (v[j][y] - v[i][y]);
      e.b = sign * (v[j][x] - v[i][x]);
      e.base = -(e.a * v[i][x] + e.b * v[i][y]);
      e.touch = (e.base >> cell_bits) + positive_part(e.a) + positive_part(e.b);
      if (d != 2) continue;
      at_column[i] = e.base + (e.a + e.b) * (Int{1} << (cell_bits - 3));
      column[i] = at_column[i] >> (cell_bits - 2);
    }
  }

  VOXDAG_HD void set_plane() {
    int128 offset = 0;
    for (int a = 0; a < 3; ++a) offset -= static_cast<int128>(normal[a]) * v[0][a];
    plane_floor = static_cast<Int>(offset >> cell_bits);
    plane_ceil = static_cast<Int>(-(-offset >> cell_bits));
    offset += (static_cast<int128>(normal[0]) + normal[1]) << (cell_bits - 3);
    column_floor = static_cast<Int>(offset >> (cell_bits - 2));
    column_ceil = static_cast<Int>(-(-offset >> (cell_bits - 2)));
    for (int a = 0; a < 2; ++a) slope[a] = -to_double(normal[a]) / to_double(normal[2]);
  }
};

}  // namespace voxdag::color
