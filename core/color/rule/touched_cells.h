// Finds the cells of a range that a triangle touches, and the columns in which it covers each of
// these cells. The result is exact, and depends only on the triangle and the cell.
//
// The search visits columns of cells along the triangle's dominant axis. The projections of the
// triangle and of a column of cells along this axis are the triangle's shadow and the column's
// square. If the shadow contains the complete closed square, the triangle touches exactly the cells
// of the column that its plane touches. If the shadow only touches the square, the edge tests in
// the other two projections also decide.
//
// If the plane hardly rises along a row, it touches the same single cell in many consecutive
// columns of cells. A short loop without other tests visits such a run.
//
// From one column of cells to the next, the plane rises or falls by at most one cell. So the
// plane's height is updated by additions. In the first column of a row the height is estimated in
// doubles, and the estimate is corrected with exact values.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/columns.h"

namespace voxdag::color {

// A box of cells, along the permuted axes of a triangle (cell_triangle.h). Positions are counted in
// cells from the grid's origin; `last` is inclusive.
struct CellRange {
  int64_t first[3], last[3];
};

template <class Int>
class TouchedCells {
 public:
  VOXDAG_HD TouchedCells(const CellTriangle<Int>& triangle, const CellRange& range)
      : t_(triangle), range_(range) {
    for (int i = 0; i < 3; ++i)
      margin_[i] = magnitude(t_.edges[2][i].a) + magnitude(t_.edges[2][i].b);
    is_level_ = 4 * magnitude(t_.normal[1]) <= t_.normal[2];
    rise_ = positive_part(t_.normal[0]) + positive_part(t_.normal[1]);
    fall_ = negative_part(t_.normal[0]) + negative_part(t_.normal[1]);
  }

  // Calls visit(p, q, r, columns) for each touched cell, once. `columns` is the set of the cell's
  // columns that the triangle covers (columns.h).
  template <class Visit>
  VOXDAG_HD void visit(Visit&& visit) {
    for (int64_t p = range_.first[0]; p <= range_.last[0]; ++p) visit_row(p, visit);
  }

 private:
  template <class Visit>
  VOXDAG_HD void visit_row(int64_t p, Visit&& visit) {
    Int at[3];
    for (int i = 0; i < 3; ++i) {
      const auto& e = t_.edges[2][i];
      at[i] = e.a * p + e.b * range_.first[1] + e.touch;
    }
    bool following = false;
    for (int64_t q = range_.first[1]; q <= range_.last[1];) {
      const bool touched = (at[0] | at[1] | at[2]) >= 0;
      if (touched) {
        following ? climb() : find_plane(p, q);
        if (is_level_ && first_ == last_ && is_inside(at)) {
          following = true;
          q = visit_run(p, q, at, visit);
          continue;
        }
        visit_column(p, q, at, visit);
      } else if (following) {
        return;  // the shadow is convex, so it touches no later square of the row
      }
      following = touched;
      ++q;
      for (int i = 0; i < 3; ++i) at[i] += t_.edges[2][i].b;
    }
  }

  // True if the shadow contains the closed square for which the edge functions have the maxima
  // `at`.
  VOXDAG_HD bool is_inside(const Int (&at)[3]) const {
    return !t_.degenerate &&
           ((at[0] - margin_[0]) | (at[1] - margin_[1]) | (at[2] - margin_[2])) >= 0;
  }

  // Visits the column of cells (p, q) and the following ones of the row, as long as the shadow
  // contains their squares and the plane touches only the cell first_. This must be the case for
  // (p, q). Most cells of large triangles are in such runs. Moves `at` to the first square after
  // the run, and returns its q. highest_ and lowest_ remain those of the run's last square.
  template <class Visit>
  VOXDAG_HD int64_t visit_run(int64_t p, int64_t q, Int (&at)[3], Visit&& visit) {
    const Int b[3] = {t_.edges[2][0].b, t_.edges[2][1].b, t_.edges[2][2].b};
    const Int n = t_.normal[2], step = magnitude(t_.normal[1]);
    Int inside[3] = {at[0] - margin_[0], at[1] - margin_[1], at[2] - margin_[2]};
    // >= 0 as long as the plane rises into no higher cell, or falls into no lower one.
    Int room = t_.normal[1] < 0 ? lowest_ + n - 1 : n - 1 - highest_;
    const int64_t begin = q, r = first_;
    const bool is_in_range = r >= range_.first[2] && r <= range_.last[2];
    do {
      if (is_in_range) visit(p, q, r, kAllColumns);
      ++q;
      for (int i = 0; i < 3; ++i) inside[i] += b[i];
      room -= step;
    } while (q <= range_.last[1] && (inside[0] | inside[1] | inside[2] | room) >= 0);
    for (int i = 0; i < 3; ++i) at[i] = inside[i] + margin_[i];
    highest_ += t_.normal[1] * (q - begin - 1);
    lowest_ += t_.normal[1] * (q - begin - 1);
    return q;
  }

  // Sets first_ and last_ to the range of cells that the plane touches in the column of cells (p,
  // q), and highest_ and lowest_ as correct() does.
  VOXDAG_HD void find_plane(int64_t p, int64_t q) {
    if (t_.degenerate) {
      first_ = range_.first[2];
      last_ = range_.last[2];
      return;
    }
    const double edge = static_cast<double>(int64_t{1} << t_.cell_bits);
    const double height =
        static_cast<double>(t_.v[0][2]) +
        t_.slope[0] * (static_cast<double>(p) * edge - static_cast<double>(t_.v[0][0])) +
        t_.slope[1] * (static_cast<double>(q) * edge - static_cast<double>(t_.v[0][1]));
    first_ = last_ = floor_of(height / edge);
    const Int column = wrapping_sum(wrapping_product<Int>(t_.normal[0], p),
                                    wrapping_product<Int>(t_.normal[1], q));
    const Int at_cell = wrapping_sum(column, wrapping_product<Int>(t_.normal[2], first_));
    highest_ = wrapping_sum(wrapping_sum(at_cell, t_.plane_floor), rise_ + t_.normal[2]);
    lowest_ = wrapping_sum(wrapping_sum(at_cell, t_.plane_ceil), fall_);
    correct();
  }
  // Updates first_, last_, highest_ and lowest_ from one column of cells to the next column in the
  // row.
  VOXDAG_HD void climb() {
    if (t_.degenerate) return;
    // From one column of cells to the next, the plane rises or falls by at most one cell, so one
    // step of correct() is enough. The step has no branches, because the CPU would often mispredict
    // them.
    const Int n = t_.normal[2];
    highest_ += t_.normal[1];
    lowest_ += t_.normal[1];
    const Int up = Int{highest_ >= n} - Int{highest_ < 0};
    const Int down = Int{lowest_ > 0} - Int{lowest_ + n <= 0};
    first_ -= static_cast<int64_t>(up);
    highest_ -= n * up;
    last_ -= static_cast<int64_t>(down);
    lowest_ -= n * down;
  }
  // Sets first_ to the first cell where the plane's highest value is >= 0, and last_ to the last
  // cell where the plane's lowest value is <= 0. Sets highest_ and lowest_ to these values.
  VOXDAG_HD void correct() {
    const Int n = t_.normal[2];
    for (; highest_ < 0; ++first_) highest_ += n;
    for (; highest_ >= n; --first_) highest_ -= n;
    for (; lowest_ > 0; --last_) lowest_ -= n;
    for (; lowest_ + n <= 0; ++last_) lowest_ += n;
  }

  template <class Visit>
  VOXDAG_HD void visit_column(int64_t p, int64_t q, const Int (&at)[3], Visit&& visit) {
    const int64_t first = first_ > range_.first[2] ? first_ : range_.first[2];
    const int64_t last = last_ < range_.last[2] ? last_ : range_.last[2];
    if (first > last) return;
    const bool inside = is_inside(at);
    const uint32_t columns = t_.degenerate ? 0 : inside ? kAllColumns : columns_in_shadow(p, q);
    // If the plane touches several cells of this column of cells, the covered columns are divided
    // among them.
    const bool split = first_ != last_ && columns != 0;
    const bool exact = t_.column_floor == t_.column_ceil;
    Int at_bottom = 0;
    uint32_t above_bottom = kAllColumns;
    if (split) {
      at_bottom = wrapping_sum(
          wrapping_sum(wrapping_product<Int>(t_.normal[0], 4 * p),
                       wrapping_product<Int>(t_.normal[1], 4 * q)),
          wrapping_sum(wrapping_product<Int>(t_.normal[2], 4 * first), t_.column_floor));
      if (first != first_) above_bottom = columns_above(at_bottom, exact);
    }
    for (int64_t r = first; r <= last; ++r) {
      uint32_t covered = columns & above_bottom;
      if (split && r != last_) {
        at_bottom = wrapping_sum(at_bottom, wrapping_product<Int>(t_.normal[2], 4));
        above_bottom = columns_above(at_bottom, false);
        covered &= ~above_bottom;
        if (exact) above_bottom = columns_above(at_bottom, true);
      }
      if (inside || touches_from_sides(p, q, r)) visit(p, q, r, covered);
    }
  }

  VOXDAG_HD bool touches_from_sides(int64_t p, int64_t q, int64_t r) const {
    for (int i = 0; i < 3; ++i) {
      const auto &side = t_.edges[0][i], &other = t_.edges[1][i];
      if (side.a * q + side.b * r + side.touch < 0) return false;
      if (other.a * r + other.b * p + other.touch < 0) return false;
    }
    return true;
  }

  VOXDAG_HD uint32_t columns_in_shadow(int64_t p, int64_t q) const {
    uint32_t outside = 0;
    for (int i = 0; i < 3; ++i) {
      const auto& e = t_.edges[2][i];
      outside |= negative_columns<Int>(e.a * (4 * p) + e.b * (4 * q) + t_.column[i], e.a, e.b);
    }
    return ~outside & kAllColumns;
  }

  // Returns the columns in which the triangle's plane is above the bottom of a cell. If `or_in` is
  // set, also returns the columns in which the plane is exactly at the bottom. This requires that
  // rounding has not changed the plane's values. `at_bottom`: the plane's value at the cell's first
  // column and bottom, rounded down.
  VOXDAG_HD uint32_t columns_above(Int at_bottom, bool or_in) const {
    return negative_columns<Int>(wrapping_sum(at_bottom, Int{or_in ? -1 : 0}), t_.normal[0],
                                 t_.normal[1]);
  }

  const CellTriangle<Int>& t_;
  const CellRange& range_;
  Int margin_[3];  // an edge function's maximum minus its minimum over a cell
  // True if the plane's slope along axis 1 is at most 1/4. Only then are runs long enough to save
  // more time than their branches cost, which the CPU often mispredicts.
  bool is_level_;
  Int rise_, fall_;  // the plane's rise and fall over a cell, along axes 0 and 1
  // first_ and last_ are the first and the last cell that the plane touches in the current column
  // of cells. highest_ is the highest value of the plane's function in the first cell, and lowest_
  // is the lowest value in the last cell.
  int64_t first_ = 0, last_ = 0;
  Int highest_ = 0, lowest_ = 0;
};

}  // namespace voxdag::color
