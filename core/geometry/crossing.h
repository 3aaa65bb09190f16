// The exact crossing of a triangle with a row: a line through lattice points along an axis. The
// voxel rule kThin (voxel_rule.h) and the rules for solids (solid_rule.h) both use this test.
//
// Row points have even coordinates and vertices odd ones, so no row meets a vertex. Each point is
// thought of as moved by (e, e^2, e^3), where e > 0 is infinitely small. Then no row meets an edge
// and no point is on a triangle's plane: ties have an exact answer. If several triangles share an
// edge, a row through the edge crosses the surface as a row next to the edge would: it neither
// crosses twice nor slips between the triangles.
//
// Let a be the axis of the row, (a, b, c) the axes in cyclic order, n the triangle's normal, u and
// w the ends of an edge, v a vertex, and p a point:
//
//   crosses    n_a is not 0, and for every edge the value
//                  g = (w_b - u_b)(p_c - u_c) - (w_c - u_c)(p_b - u_b)
//              has the sign of n_a. If g = 0, the sign of -(w_c - u_c) counts, or if this is 0, the
//              sign of (w_b - u_b). If c < b, the sign of (w_b - u_b) is tested first.
//   beyond     F = n.(p - v) has the sign of n_a: the crossing is before p on the row. If F = 0,
//              the sign is the sign of the first component of n that is not 0.
//   sign       +1 where a ray along +a enters the solid that the triangle bounds, which is where
//              n_a < 0; otherwise -1
//
// Degenerate triangles, and triangles parallel to the row, cross nothing.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/base/integers.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

// Returns the largest integer <= x / y; y > 0.
template <class Int>
VOXDAG_HD constexpr Int floor_divide(Int x, Int y) {
  const Int quotient = x / y;
  return quotient - (quotient * y > x ? 1 : 0);
}

// Limits of a triangle's coordinates and extents, in lattice units, for RowTest in 64 bits.
inline constexpr int64_t kRowCoordinate = int64_t{1} << 30;
inline constexpr int64_t kRowExtent = int64_t{1} << 20;

// A triangle and the rows along one axis. `EdgeInt` is the type of g and `PlaneInt` the type of F:
//
//   EdgeInt 64 bits    coordinates of the triangle and the points are below kRowCoordinate
//   PlaneInt 64 bits   extents of the triangle are below kRowExtent, and points of is_beyond() are
//                      less than kRowExtent away from its first vertex along every axis
//   128 bits           coordinates are at most kCoordinateLimit
//
// crosses() may be called with any row. The results of first_beyond(), is_beyond() and
// crosses_leg() have a meaning only for a row that the triangle crosses. For such a row, a 64-bit
// PlaneInt is enough for first_beyond() with any step.
template <class EdgeInt, class PlaneInt>
class RowTest {
 public:
  VOXDAG_HD RowTest(const FixedTriangle& triangle, int axis)
      : a_(axis), b_((axis + 1) % 3), c_((axis + 2) % 3) {
    for (int k = 0; k < 3; ++k) vertex_[k] = triangle.v[0][k];
    set_normal(triangle);
    if (n_[a_] == 0) return;
    if (n_[a_] > 0) sign_ = -1;
    if (n_[a_] < 0) sign_ = 1;
    const bool is_rising = n_[0] != 0 ? n_[0] > 0 : n_[1] != 0 ? n_[1] > 0 : n_[2] > 0;
    // From here on, n_ is the normal times the sign of its component n_a, so that n_a > 0.
    beyond_at_zero_ = is_rising == (n_[a_] > 0);
    for (PlaneInt& x : n_) x *= -sign_;
    for (int i = 0; i < 3; ++i) set_edge(i, triangle.v[i], triangle.v[(i + 1) % 3]);
  }

  // Returns the sign of the triangle's crossings: 0 if it crosses no row along the axis.
  VOXDAG_HD int sign() const { return sign_; }

  // The values of the three edges' tests (Edge) at a row: the triangle crosses the row iff all
  // values are >= 0. edge_steps() returns the increase of these values if the row moves by
  // `distance` units along axis c (along axis b if `is_along_c` is false).
  struct EdgeValues {
    EdgeInt of[3];
  };
  VOXDAG_HD EdgeValues edges_at(int64_t at_b, int64_t at_c) const {
    EdgeValues out;
    for (int i = 0; i < 3; ++i)
      out.of[i] = edges_[i].rise * static_cast<EdgeInt>(at_c) -
                  edges_[i].run * static_cast<EdgeInt>(at_b) - edges_[i].least;
    return out;
  }
  VOXDAG_HD EdgeValues edge_steps(bool is_along_c, int64_t distance) const {
    EdgeValues out;
    for (int i = 0; i < 3; ++i)
      out.of[i] = (is_along_c ? edges_[i].rise : -edges_[i].run) * static_cast<EdgeInt>(distance);
    return out;
  }
  // Sets the slopes of the triangle's plane. If a row moves by one unit along axis k, the point at
  // which it crosses the plane moves by -slope[k] along the row.
  VOXDAG_HD void slopes(double (&slope)[3]) const {
    const double inverse = 1 / static_cast<double>(n_[a_]);
    for (int k = 0; k < 3; ++k) slope[k] = static_cast<double>(n_[k]) * inverse;
  }

  // True if the triangle crosses the row through p, whose coordinate along the axis is ignored.
  VOXDAG_HD bool crosses(const int64_t (&p)[3]) const { return crosses(p[b_], p[c_]); }
  // True if the triangle crosses the row with the coordinates `at_b` and `at_c` on the next two
  // axes after `axis`.
  VOXDAG_HD bool crosses(int64_t at_b, int64_t at_c) const {
    if (sign_ == 0) return false;
    bool inside = true;
    for (const Edge& e : edges_)
      inside &= e.rise * static_cast<EdgeInt>(at_c) - e.run * static_cast<EdgeInt>(at_b) >= e.least;
    return inside;
  }

  // True if p is beyond the crossing (see above) on the row through p.
  VOXDAG_HD bool is_beyond(const int64_t (&p)[3]) const {
    return height(p[b_], p[c_]) + n_[a_] * static_cast<PlaneInt>(p[a_] - vertex_[a_]) >= 0;
  }

  // Returns the smallest integer k for which the point k * 2^step_log2 of the row is beyond the
  // crossing. So the crossing is between the points k - 1 and k.
  VOXDAG_HD int64_t first_beyond(int64_t at_b, int64_t at_c, int step_log2) const {
    // n_a (x - v_a) + height >= 0  <=>  x >= v_a + ceil(-height / n_a)
    const PlaneInt up = -floor_divide(height(at_b, at_c), n_[a_]);
    const int64_t first = vertex_[a_] + static_cast<int64_t>(up);
    return (first + (int64_t{1} << step_log2) - 1) >> step_log2;
  }

  // True if the triangle crosses the leg: the part of a row from p to the point `length` units
  // further along the axis; length > 0.
  VOXDAG_HD bool crosses_leg(const int64_t (&p)[3], int64_t length) const {
    if (!crosses(p) || is_beyond(p)) return false;
    int64_t end[3] = {p[0], p[1], p[2]};
    end[a_] += length;
    return is_beyond(end);
  }

 private:
  // An edge as the test rise * p_c - run * p_b >= least.
  struct Edge {
    EdgeInt rise, run, least;
  };

  VOXDAG_HD void set_normal(const FixedTriangle& t) {
    PlaneInt e[2][3];
    for (int i = 0; i < 2; ++i)
      for (int k = 0; k < 3; ++k) e[i][k] = static_cast<PlaneInt>(t.v[i + 1][k] - t.v[i][k]);
    for (int k = 0; k < 3; ++k)
      n_[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
  }

  VOXDAG_HD void set_edge(int i, const int64_t (&u)[3], const int64_t (&w)[3]) {
    Edge& e = edges_[i];
    e.rise = static_cast<EdgeInt>(w[b_] - u[b_]) * -sign_;
    e.run = static_cast<EdgeInt>(w[c_] - u[c_]) * -sign_;
    const bool falls_first = e.run != 0 && (b_ < c_ || e.rise == 0);
    const bool inside_at_zero = falls_first ? e.run < 0 : e.rise > 0;
    e.least = e.rise * static_cast<EdgeInt>(u[c_]) - e.run * static_cast<EdgeInt>(u[b_]) +
              (inside_at_zero ? 0 : 1);
  }

  // Returns the value of F (see above) for p_a = v_a, multiplied by the sign of n_a. Subtracts 1 if
  // F = 0 counts as negative, so that is_beyond() can compare with 0.
  VOXDAG_HD PlaneInt height(int64_t at_b, int64_t at_c) const {
    return n_[b_] * static_cast<PlaneInt>(at_b - vertex_[b_]) +
           n_[c_] * static_cast<PlaneInt>(at_c - vertex_[c_]) - (beyond_at_zero_ ? 0 : 1);
  }

  int a_, b_, c_;
  int sign_ = 0;
  bool beyond_at_zero_ = false;
  int64_t vertex_[3];
  PlaneInt n_[3];  // multiplied by the sign of n_a, so that n_[a_] > 0
  Edge edges_[3];
};

// NarrowRowTest is for triangles that satisfy has_row_extents() and has_row_coordinates().
// GridRowTest is for triangles that satisfy has_row_coordinates(). WideRowTest is for all
// triangles.
using NarrowRowTest = RowTest<int64_t, int64_t>;
using GridRowTest = RowTest<int64_t, int128>;
using WideRowTest = RowTest<int128, int128>;

// True if the coordinates of the triangle are below kRowCoordinate, so that GridRowTest is exact.
VOXDAG_HD inline bool has_row_coordinates(const FixedTriangle& t) {
  bool fits = true;
  for (int k = 0; k < 3; ++k) fits &= t.low(k) > -kRowCoordinate && t.high(k) < kRowCoordinate;
  return fits;
}

// True if the extents are below kRowExtent, so that NarrowRowTest is exact for crosses() and
// first_beyond(). Requires has_row_coordinates().
VOXDAG_HD inline bool has_row_extents(const FixedTriangle& t) {
  bool fits = true;
  for (int k = 0; k < 3; ++k) fits &= t.high(k) - t.low(k) < kRowExtent;
  return fits;
}

// Calls visit(test) with the RowTest with the fewest bits whose crosses() and first_beyond() are
// exact for the triangle. The points passed to `test` must be inside a grid of kMaxGridLevels.
template <class Visit>
inline void with_row_test(const FixedTriangle& t, int axis, Visit visit) {
  if (!has_row_coordinates(t))
    visit(WideRowTest(t, axis));
  else if (!has_row_extents(t))
    visit(GridRowTest(t, axis));
  else
    visit(NarrowRowTest(t, axis));
}

// Returns the sign of the triangle's crossing with a leg, or 0 if the triangle does not cross it.
// The leg is the part of a row from p to the point `length` > 0 units further along `axis`.
// Requires |coordinates| <= kCoordinateLimit.
VOXDAG_HD inline int leg_crossing(const FixedTriangle& t, const int64_t (&p)[3], int axis,
                                  int64_t length) {
  for (int k = 1; k < 3; ++k) {
    const int other = (axis + k) % 3;
    if (t.low(other) > p[other] || t.high(other) < p[other]) return 0;
  }
  if (t.low(axis) > p[axis] + length || t.high(axis) < p[axis]) return 0;
  const WideRowTest test(t, axis);
  return test.crosses_leg(p, length) ? test.sign() : 0;
}

}  // namespace voxdag
