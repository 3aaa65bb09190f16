// Finds the children of a cube that a triangle may touch: the overlap test for all eight children
// in one step, in doubles. The four elements of a Quad belong either to the three edges of the
// triangle (the fourth element is ignored) or to four children.
//
// The test need not be exact, because the rasterizers are exact. It sometimes reports a child that
// the triangle does not touch. Two errors must never happen: to omit a touched child, and to report
// a child as inside (see Entry in triangle_set.h) although the triangle does not cover it. So
// bounds for touched children are widened, and bounds for inside children narrowed, by more than
// the rounding error. Vertices and edges are exact in doubles (below 2^42). Normals are computed in
// integers and rounded once. All other values are sums of at most eight products. A product of a
// coefficient and a distance has an error of at most 3 * 2^-53 |coefficient| |distance|.
//
// Quad is a vector of four doubles with arithmetic operators. load(coordinates, origin) returns the
// coordinates relative to the origin. The other functions of a Quad are
//   rotated()          elements 1, 2, 0, 3
//   clamp_to_zero()    max(x, 0)
//   negative()         the sign bits, one per element
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/kernels.h"
#include "core/base/integers.h"
#include "core/base/popcount8.h"
#include "core/geometry/cube.h"

namespace voxdag::cpu {

// children[d][set] is the mask of the children in a set of columns along axis d. Each of the four
// columns is two children long. The number of a column's bit in the set is the column's coordinate
// along axis d + 1 plus twice its coordinate along axis d + 2 (axes modulo 3).
struct ColumnTable {
  uint8_t children[3][16] = {};
  constexpr ColumnTable() {
    for (int d = 0; d < 3; ++d)
      for (int set = 0; set < 16; ++set)
        for (int c = 0; c < 8; ++c) {
          const int column = child_coordinate(c, (d + 1) % 3) | child_coordinate(c, (d + 2) % 3)
                                                                    << 1;
          children[d][set] |= static_cast<uint8_t>((set >> column & 1) << c);
        }
  }
};
inline constexpr ColumnTable kColumns;
inline constexpr uint8_t kLowChildren[3] = {0x0f, 0x33, 0x55};
inline constexpr double kRoundingSlack = 0x1p-47;

template <class Quad, class Coordinate>
struct OctantTest {
  using Int = typename TileTriangle<Coordinate>::Int;

  const Triangle<Coordinate>& t;
  const LatticeCube& cube;
  double half;        // edge of a child
  double reach;       // max |coordinate| of vertices and cube, relative to the cube's low corner
  int long_axes = 0;  // number of axes along which the triangle is at least as long as a child
  double normal[3];

  OctantTest(const Triangle<Coordinate>& triangle, const LatticeCube& box)
      : t(triangle), cube(box) {
    half = static_cast<double>(cube.edge / 2);
  }

  // Returns exactly the children that the triangle's box touches. Sets `reach` and `long_axes`.
  uint32_t box_test() {
    uint32_t touched = 0xff;
    int64_t farthest = cube.edge;
    for (int a = 0; a < 3; ++a) {
      const int64_t v0 = t.v[a][0] - cube.low[a], v1 = t.v[a][1] - cube.low[a],
                    v2 = t.v[a][2] - cube.low[a];
      int64_t low = v0 < v1 ? v0 : v1, high = v0 < v1 ? v1 : v0;
      low = v2 < low ? v2 : low;
      high = v2 > high ? v2 : high;
      if (low > cube.edge / 2) touched &= ~kLowChildren[a];
      if (high < cube.edge / 2) touched &= kLowChildren[a];
      farthest = high > farthest ? high : farthest;
      farthest = -low > farthest ? -low : farthest;
      long_axes += high - low >= cube.edge / 2;
    }
    reach = static_cast<double>(farthest);
    return touched & 0xff;
  }

  void set_normal() {
    Int e[3][2];
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < 2; ++i) e[a][i] = static_cast<Int>(t.v[a][i + 1]) - t.v[a][i];
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      normal[a] = static_cast<double>(e[b][0] * e[c][1] - e[c][0] * e[b][1]);
    }
  }

  // Returns the children that the plane may cross.
  uint32_t plane_test() const {
    double rising = 0, falling = 0, at_low = 0;
    for (int a = 0; a < 3; ++a) {
      (normal[a] > 0 ? rising : falling) += normal[a];
      at_low -= normal[a] * static_cast<double>(t.v[a][0] - cube.low[a]);
    }
    const double slack = (rising - falling) * reach * kRoundingSlack;
    const Quad columns = Quad(0, normal[2], normal[1], normal[1] + normal[2]) * Quad(half);
    uint32_t touched = 0;
    for (int k = 0; k < 2; ++k) {
      const double base = at_low + k * half * normal[0];
      const Quad highest = columns + Quad(base + half * rising + slack);
      const Quad lowest = Quad(slack - base - half * falling) - columns;
      touched |= (highest.negative() | lowest.negative()) << 4 * k;
    }
    return ~touched & 0xff;
  }

  // Returns the children that may touch the inner side of all edges, in the projection along axis
  // d. `inside`, if not null, receives the children that are completely on the inner side of all
  // edges.
  uint32_t edge_test(int d, uint32_t* inside) const {
    const int p = (d + 1) % 3, q = (d + 2) % 3;
    const Quad vp = Quad::load(t.v[p], cube.low[p]), vq = Quad::load(t.v[q], cube.low[q]);
    const Quad sign(normal[d] < 0 ? -1.0 : 1.0);
    const Quad a = (vq - vq.rotated()) * sign, b = (vp.rotated() - vp) * sign;
    const Quad at_low = Quad(0.0) - (a * vp + b * vq);
    const Quad rise_a = a.clamp_to_zero(), rise_b = b.clamp_to_zero();
    const Quad size = rise_a + rise_b + (rise_a - a) + (rise_b - b);
    const Quad slack = size * Quad(reach * kRoundingSlack), half4(half);
    const Quad highest = at_low + (rise_a + rise_b) * half4 + slack;
    const Quad step_a = a * half4, step_b = b * half4, step_ab = step_a + step_b;
    uint32_t columns = 0;
    columns |= (highest.negative() & 7) == 0 ? 1 : 0;
    columns |= ((highest + step_a).negative() & 7) == 0 ? 2 : 0;
    columns |= ((highest + step_b).negative() & 7) == 0 ? 4 : 0;
    columns |= ((highest + step_ab).negative() & 7) == 0 ? 8 : 0;
    if (inside != nullptr) {
      const Quad lowest = highest - size * half4 - (slack + slack);
      uint32_t covered = 0;
      covered |= (lowest.negative() & 7) == 0 ? 1 : 0;
      covered |= ((lowest + step_a).negative() & 7) == 0 ? 2 : 0;
      covered |= ((lowest + step_b).negative() & 7) == 0 ? 4 : 0;
      covered |= ((lowest + step_ab).negative() & 7) == 0 ? 8 : 0;
      *inside = kColumns.children[d][covered];
    }
    return kColumns.children[d][columns];
  }

  Octants run(bool whole_cube_inside) {
    Octants out{box_test(), 0};
    // If so few children remain, the plane and edge tests would cost more than they save. A
    // triangle shorter than a child along two axes covers no child, and if its box touches two
    // children, it most likely touches both.
    if (!whole_cube_inside && kPopcount8[out.touched] <= (long_axes < 2 ? 2 : 1)) return out;
    set_normal();
    out.touched &= plane_test();
    if (whole_cube_inside) return {out.touched, out.touched};
    const double size[3] = {normal[0] < 0 ? -normal[0] : normal[0],
                            normal[1] < 0 ? -normal[1] : normal[1],
                            normal[2] < 0 ? -normal[2] : normal[2]};
    int dominant = size[1] > size[0] ? 1 : 0;
    if (size[2] > size[dominant]) dominant = 2;
    for (int d = 0; d < 3 && out.touched != 0; ++d) {
      const bool covers = d == dominant && size[d] > 0;
      out.touched &= edge_test(d, covers ? &out.inside : nullptr);
    }
    out.inside &= out.touched;
    return out;
  }
};

}  // namespace voxdag::cpu
