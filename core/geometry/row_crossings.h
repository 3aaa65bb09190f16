// The crossings of a triangle with the sample rows of a cube (solid_rule.h).
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "core/geometry/crossing.h"
#include "core/geometry/solid_rule.h"

namespace voxdag {

// Finds the first sample point of a row beyond the place where the row crosses a triangle. Sample
// points are at multiples of 2^step_log2. Estimates the place in floating point, and uses the exact
// integer test (RowTest) only if a sample point is within the estimate's error.
class FirstBeyond {
 public:
  template <class Test>
  FirstBeyond(const Test& test, const FixedTriangle& t, int axis, int step_log2)
      : triangle_(t),
        axis_(axis),
        step_log2_(step_log2),
        v_first_(t.v[0][first_row_axis(axis)]),
        v_second_(t.v[0][second_row_axis(axis)]) {
    // All estimates are in steps. A multiplication by `steps`, a power of two, is exact.
    const double steps = 1 / static_cast<double>(int64_t{1} << step_log2);
    const int first = first_row_axis(axis), second = second_row_axis(axis);
    double slope[3];
    test.slopes(slope);
    slope_first_ = slope[first] * steps;
    slope_second_ = slope[second] * steps;
    at_v_ = static_cast<double>(t.v[0][axis]) * steps;
    // The error of the estimate in find(): a slope is rounded up to four times, and the products
    // and sums a few times, each time by at most 2^-53 of a term. Every term is at most about
    // `largest`, so the error is below largest * 2^-49. Half a lattice unit is added as a reserve.
    const double largest = std::abs(at_v_) + std::abs(slope_first_) * extent(t, first) +
                           std::abs(slope_second_) * extent(t, second);
    margin_ = largest < kMaxEstimate ? 0.5 * steps + largest * 0x1p-49 : 1;
  }

  // Selects the rows with the coordinate `at_first` along first_row_axis().
  void select(int64_t at_first) {
    at_first_ = at_first;
    at_line_ = at_v_ - slope_first_ * static_cast<double>(at_first - v_first_);
  }
  // Returns the smallest k for which the point k * 2^step_log2 of a row is beyond the row's
  // crossing with the triangle. `at_second`: the row's coordinate along second_row_axis(). The
  // triangle must cross the row.
  int64_t find(int64_t at_second) const {
    const double at = at_line_ - slope_second_ * static_cast<double>(at_second - v_second_);
    // The sum has no fraction bits, so its low bits are the integer nearest to `at`.
    const double sum = at + kRound;
    const double above = at - (sum - kRound);  // above this integer, between -1/2 and 1/2
    if (std::abs(above) > margin_)
      return std::bit_cast<int64_t>(sum) - std::bit_cast<int64_t>(kRound) + (above > 0 ? 1 : 0);
    return find_exactly(at_second);
  }

 private:
  static constexpr double kRound = 0x1.8p52;
  // For larger estimates, find() always uses the exact test: its margin is 1.
  static constexpr double kMaxEstimate = 0x1p41;

  [[gnu::noinline]] int64_t find_exactly(int64_t at_second) const {
    const bool first_is_b = first_row_axis(axis_) == (axis_ + 1) % 3;
    const int64_t at_b = first_is_b ? at_first_ : at_second;
    const int64_t at_c = first_is_b ? at_second : at_first_;
    int64_t k = 0;
    with_row_test(triangle_, axis_,
                  [&](const auto& test) { k = test.first_beyond(at_b, at_c, step_log2_); });
    return k;
  }
  static double extent(const FixedTriangle& t, int axis) {
    return static_cast<double>(t.high(axis) - t.low(axis));
  }

  const FixedTriangle& triangle_;
  const int axis_, step_log2_;
  const int64_t v_first_, v_second_;
  double at_v_, slope_first_, slope_second_, margin_;
  int64_t at_first_ = 0;
  double at_line_ = 0;
};

// The sample rows of a closed cube: lattice lines at a distance of 2^pitch_log2 units. The
// coordinates of the cube's low corner are multiples of this distance.
struct SampleRows {
  int64_t low[3];  // the cube's low corner, in lattice units
  int pitch_log2;
  int blocks;  // the cube's edge, in multiples of the rows' distance

  // Returns the index of row (i, j) in the list of the cube's rows along one axis (solid_rule.h).
  size_t index(int i, int j) const { return static_cast<size_t>(i * (blocks + 1) + j); }

  // Calls visit(i, j, block, sign) for every crossing of the triangle with a row along `axis`. (i,
  // j) are the row's indices along first_row_axis() and second_row_axis(). The crossing is between
  // the points `block` and `block + 1` of the row, which are 2^pitch_log2 units apart and are
  // counted from the cube's low side. These points can be outside the cube.
  template <class Visit>
  void for_each_crossing(const FixedTriangle& triangle, int axis, Visit visit) const {
    const int first = first_row_axis(axis), second = second_row_axis(axis);
    const Range f = rows_of(triangle, first), s = rows_of(triangle, second);
    if (f.low > f.high || s.low > s.high) return;
    const int64_t base = low[axis] >> pitch_log2;
    const auto visit_rows = [&](const auto& test) {
      if (test.sign() == 0) return;
      FirstBeyond first_beyond(test, triangle, axis, pitch_log2);
      const bool first_is_c = first == (axis + 2) % 3;
      const int64_t pitch = int64_t{1} << pitch_log2;
      const auto step = test.edge_steps(!first_is_c, pitch);
      const int64_t from_second = low[second] + s.low * pitch;
      for (int i = f.low; i <= f.high; ++i) {
        const int64_t at_first = low[first] + i * pitch;
        auto edges = first_is_c ? test.edges_at(from_second, at_first)
                                : test.edges_at(at_first, from_second);
        first_beyond.select(at_first);
        int64_t at_second = from_second;
        for (int j = s.low; j <= s.high; ++j, at_second += pitch) {
          if ((edges.of[0] | edges.of[1] | edges.of[2]) >= 0)
            visit(i, j, first_beyond.find(at_second) - 1 - base, test.sign());
          for (int e = 0; e < 3; ++e) edges.of[e] += step.of[e];
        }
      }
    };
    // For these coordinates, the normal and the edge values fit in 64 bits. FirstBeyond rarely uses
    // its exact test, which chooses its own number of bits.
    if (has_row_coordinates(triangle))
      visit_rows(NarrowRowTest(triangle, axis));
    else
      visit_rows(WideRowTest(triangle, axis));
  }

 private:
  struct Range {
    int low, high;
  };
  // Returns the range of the indices of rows whose coordinate along `axis` is within the triangle's
  // bounding box. `axis` is one of the two axes across the rows.
  Range rows_of(const FixedTriangle& t, int axis) const {
    const int64_t from = t.low(axis) - low[axis], to = t.high(axis) - low[axis];
    if (to < 0 || from > int64_t{blocks} << pitch_log2) return {1, 0};
    const int64_t first = from <= 0 ? 0 : ((from - 1) >> pitch_log2) + 1;
    return {static_cast<int>(first), static_cast<int>(std::min<int64_t>(to >> pitch_log2, blocks))};
  }
};

}  // namespace voxdag
