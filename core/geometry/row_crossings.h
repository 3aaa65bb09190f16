// The crossings of a triangle with the sample rows of a cube (solid_rule.h).
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/geometry/crossing.h"
#include "core/geometry/solid_rule.h"

namespace voxdag {

// The sample rows of a closed cube: lattice lines at a distance of 2^pitch_log2 units, which
// divides the cube's low corner.
struct SampleRows {
  int64_t low[3];  // the cube's low corner, in lattice units
  int pitch_log2;
  int blocks;  // the cube's edge, in multiples of the distance

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
      int64_t p[3] = {0, 0, 0};
      for (int i = f.low; i <= f.high; ++i) {
        p[first] = low[first] + (int64_t{i} << pitch_log2);
        for (int j = s.low; j <= s.high; ++j) {
          p[second] = low[second] + (int64_t{j} << pitch_log2);
          if (!test.crosses(p)) continue;
          const int64_t beyond =
              test.first_beyond(p[(axis + 1) % 3], p[(axis + 2) % 3], pitch_log2);
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
