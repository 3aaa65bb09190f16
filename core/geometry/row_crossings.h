// The crossings of a triangle with the sample rows of a cube (solid_rule.h).
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/geometry/crossing.h"
#include "core/geometry/solid_rule.h"

namespace voxdag {

// Finds the first point of a row that is beyond a triangle. A division of 128-bit integers takes
// longer than two exact tests of points next to an estimate in floating point.
class FirstBeyond {
 public:
  FirstBeyond(const FixedTriangle& t, int axis) : axis_(axis) {
    double e[2][3];
    for (int i = 0; i < 2; ++i)
      for (int a = 0; a < 3; ++a) e[i][a] = static_cast<double>(t.v[i + 1][a] - t.v[i][a]);
    double n[3];
    for (int a = 0; a < 3; ++a) {
      vertex_[a] = static_cast<double>(t.v[0][a]);
      n[a] = e[0][(a + 1) % 3] * e[1][(a + 2) % 3] - e[0][(a + 2) % 3] * e[1][(a + 1) % 3];
    }
    for (int a = 0; a < 3; ++a) slope_[a] = n[a] / n[axis];
  }

  // Returns the smallest k for which the point k * 2^step_log2 of the row through p is beyond the
  // crossing. Changes p along the axis.
  template <class EdgeInt, class PlaneInt>
  int64_t find(const RowTest<EdgeInt, PlaneInt>& test, int64_t (&p)[3], int step_log2) const {
    const int b = (axis_ + 1) % 3, c = (axis_ + 2) % 3;
    if constexpr (sizeof(PlaneInt) > sizeof(int64_t)) {
      const double at = vertex_[axis_] - slope_[b] * (static_cast<double>(p[b]) - vertex_[b]) -
                        slope_[c] * (static_cast<double>(p[c]) - vertex_[c]);
      if (at > -kMaxEstimate && at < kMaxEstimate) {
        const int64_t k = (static_cast<int64_t>(at) >> step_log2) + 1;
        p[axis_] = (k - 1) << step_log2;
        if (!test.is_beyond(p)) {
          p[axis_] = k << step_log2;
          if (test.is_beyond(p)) return k;
        }
      }
    }
    return test.first_beyond(p[b], p[c], step_log2);
  }

 private:
  static constexpr double kMaxEstimate = 0x1p41;

  const int axis_;
  double vertex_[3];
  double slope_[3];  // slope_[b]: distance by which the crossing moves back per unit of axis b
};

// The sample rows of a closed cube: lattice lines at a distance of 2^pitch_log2 units. The
// coordinates of the cube's low corner are multiples of this distance.
struct SampleRows {
  int64_t low[3];  // the cube's low corner, in lattice units
  int pitch_log2;
  int blocks;  // the cube's edge, in multiples of the distance

  // Returns the index of row (i, j) in the list of the cube's rows along one axis (solid_rule.h).
  size_t index(int i, int j) const { return static_cast<size_t>(i * (blocks + 1) + j); }

  // Calls visit(i, j, block, sign) for every crossing of the triangle with a row along `axis`. (i,
  // j) are the row's indices along first_row_axis() and second_row_axis(). The crossing is between
  // the points `block` and `block + 1` of the row, which are 2^pitch_log2 units apart and are
  // counted from the cube's low side; they can be outside the cube.
  template <class Visit>
  void for_each_crossing(const FixedTriangle& triangle, int axis, Visit visit) const {
    const int first = first_row_axis(axis), second = second_row_axis(axis);
    const Range f = rows_of(triangle, first), s = rows_of(triangle, second);
    if (f.low > f.high || s.low > s.high) return;
    const int64_t base = low[axis] >> pitch_log2;
    with_row_test(triangle, axis, [&](const auto& test) {
      if (test.sign() == 0) return;
      const FirstBeyond first_beyond(triangle, axis);
      int64_t p[3] = {0, 0, 0};
      for (int i = f.low; i <= f.high; ++i) {
        p[first] = low[first] + (int64_t{i} << pitch_log2);
        for (int j = s.low; j <= s.high; ++j) {
          p[second] = low[second] + (int64_t{j} << pitch_log2);
          if (!test.crosses(p)) continue;
          const int64_t beyond = first_beyond.find(test, p, pitch_log2);
          visit(i, j, beyond - 1 - base, test.sign());
        }
      }
    });
  }

 private:
  struct Range {
    int low, high;
  };
  // Returns the rows that the triangle's box contains, along one axis of their positions.
  Range rows_of(const FixedTriangle& t, int axis) const {
    const int64_t from = t.low(axis) - low[axis], to = t.high(axis) - low[axis];
    if (to < 0 || from > int64_t{blocks} << pitch_log2) return {1, 0};
    const int64_t first = from <= 0 ? 0 : ((from - 1) >> pitch_log2) + 1;
    return {static_cast<int>(first), static_cast<int>(std::min<int64_t>(to >> pitch_log2, blocks))};
  }
};

}  // namespace voxdag
