// The cells of a range that a triangle touches, each with the columns in which it covers the cell:
// exact, and a function of triangle and cell alone.
//
// By columns of cells along the triangle's dominant axis. Where its shadow contains a column's
// whole closed square, the cells of that column that the triangle touches are those that its plane
// touches; where the shadow only touches the square, the edges in the other two projections decide
// too. From one column to the next the plane climbs by at most a cell, and so is followed by
// additions, from an estimate in doubles that exact values correct.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/columns.h"

namespace voxdag::color {

// A box of cells, along the permuted axes of a triangle; positions count cells of the whole grid.
struct CellRange {
  int64_t first[3], last[3];
};

template <class Int>
class TouchedCells {
 public:
  VOXDAG_HD TouchedCells(const CellTriangle<Int>& triangle, const CellRange& range)
      : t_(triangle), range_(range) {
    rise_ = positive_part(t_.normal[0]) + positive_part(t_.normal[1]);
    fall_ = negative_part(t_.normal[0]) + negative_part(t_.normal[1]);
  }

  // Calls visit(p, q, r, columns) for each touched cell, once.
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
    for (int64_t q = range_.first[1]; q <= range_.last[1]; ++q) {
      const bool touched = at[0] >= 0 && at[1] >= 0 && at[2] >= 0;
      if (touched) {
        following ? climb() : find_plane(p, q);
        visit_column(p, q, at, visit);
      } else if (following) {
        return;  // the shadow is convex
      }
      following = touched;
      for (int i = 0; i < 3; ++i) at[i] += t_.edges[2][i].b;
    }
  }

  // Sets first_ and last_, the cells of the column that the plane touches.
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
  // The same, from the column before.
  VOXDAG_HD void climb() {
    if (t_.degenerate) return;
    highest_ += t_.normal[1];
    lowest_ += t_.normal[1];
    correct();
  }
  // highest_ becomes the plane's highest value over cell first_, the first cell where it is >= 0;
  // lowest_ its lowest value over last_, the last where it is <= 0.
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
    bool inside = !t_.degenerate;
    for (int i = 0; i < 3; ++i)
      inside &= at[i] >= magnitude(t_.edges[2][i].a) + magnitude(t_.edges[2][i].b);
    uint32_t columns = t_.degenerate ? 0 : inside ? kAllColumns : columns_in_shadow(p, q);
    for (int64_t r = first; r <= last; ++r) {
      if (!inside && !touches_from_sides(p, q, r)) continue;
      // A column that touches one cell only has all of the plane in it.
      visit(p, q, r,
            first_ == last_ || columns == 0 ? columns : columns & columns_in_cell(p, q, r));
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
    uint32_t columns = kAllColumns;
    for (int i = 0; i < 3; ++i) {
      const auto& e = t_.edges[2][i];
      const Int first = e.a * (4 * p) + e.b * (4 * q) + t_.column[i];
      uint32_t inside = 0;
      for (int k = 0; k < 16; ++k)
        inside |= static_cast<uint32_t>(first + e.a * (k & 3) + e.b * (k >> 2) >= 0) << k;
      columns &= inside;
    }
    return columns;
  }

  // The columns in which the plane lies in the closed cell.
  VOXDAG_HD uint32_t columns_in_cell(int64_t p, int64_t q, int64_t r) const {
    const Int(&n)[3] = t_.normal;
    const Int first = wrapping_sum(
        wrapping_sum(wrapping_product<Int>(n[0], 4 * p), wrapping_product<Int>(n[1], 4 * q)),
        wrapping_product<Int>(n[2], 4 * r));
    const Int at_bottom = wrapping_sum(first, t_.column_ceil);
    const Int at_top = wrapping_sum(wrapping_sum(first, t_.column_floor), 4 * n[2]);
    uint32_t columns = 0;
    for (int k = 0; k < 16; ++k) {
      const Int climb = n[0] * (k & 3) + n[1] * (k >> 2);
      columns |= static_cast<uint32_t>(at_bottom + climb <= 0 && at_top + climb >= 0) << k;
    }
    return columns;
  }

  const CellTriangle<Int>& t_;
  const CellRange& range_;
  Int rise_, fall_;  // of the plane over a cell, along axes 0 and 1
  // The cells of the column that the plane touches, and the plane over them.
  int64_t first_ = 0, last_ = 0;
  Int highest_ = 0, lowest_ = 0;
};

}  // namespace voxdag::color
