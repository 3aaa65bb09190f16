// Computes the weight of a triangle in a cell in which it covers columns (cell_triangle.h), and the
// mean of the triangle's points on these columns.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/columns.h"
#include "core/color/rule/surface_look.h"

namespace voxdag::color {

// Weight of a surface in a cell's sum, per covered column, if the surface is perpendicular to the
// columns. Oblique surfaces have more area and up to sqrt(3) times this weight. If no triangle
// covers a column of the cell, each triangle has weight 1.
inline constexpr double kColumnWeight = 64;

struct Reciprocals {
  double of[17] = {};
  constexpr Reciprocals() {
    for (int i = 1; i <= 16; ++i) of[i] = 1.0 / i;
  }
};

template <class Int>
class CoveredSurface {
 public:
  // The triangle must outlive this object. A degenerate triangle covers nothing.
  VOXDAG_HD explicit CoveredSurface(const CellTriangle<Int>& triangle) : t_(triangle) {
    if (t_.degenerate) return;
    const double normal = to_double(t_.normal[2]);
    scale_ = static_cast<double>(kPointOne) / normal;
    column_weight_ = static_cast<uint32_t>(kColumnWeight * t_.area / normal + 0.5);
  }

  // Returns the weight in a cell of which `columns` columns are covered.
  VOXDAG_HD uint32_t weight(uint32_t columns) const { return column_weight_ * columns; }

  // Returns the mean point of the covered columns of a cell. At least one column must be covered.
  VOXDAG_HD SurfacePoint mean_point(int64_t p, int64_t q, const ColumnTotals& totals) const {
    constexpr Reciprocals kReciprocals{};
    const Int sum_p = 4 * p * totals.count + totals.sum_i;
    const Int sum_q = 4 * q * totals.count + totals.sum_j;
    const double share = kReciprocals.of[totals.count];
    return surface_point(to_double(sum_of(2, sum_p, sum_q, totals.count)) * scale_ * share,
                         to_double(sum_of(0, sum_p, sum_q, totals.count)) * scale_ * share);
  }

 private:
  // Returns the exact sum of the function of edge i (CellTriangle::Edge) over `count` columns,
  // whose coordinates P and Q add up to sum_p and sum_q. Divided by `count` and by the normal's
  // component 2, the sum is the mean weight (barycentric coordinate) of the vertex opposite to the
  // edge.
  VOXDAG_HD Int sum_of(int i, Int sum_p, Int sum_q, Int count) const {
    const auto& e = t_.edges[2][i];
    const Int quarters = wrapping_sum(wrapping_product(e.a, sum_p), wrapping_product(e.b, sum_q));
    return wrapping_sum(wrapping_product(quarters, Int{1} << (t_.cell_bits - 2)),
                        wrapping_product(count, t_.at_column[i]));
  }

  const CellTriangle<Int>& t_;
  double scale_ = 0;
  uint32_t column_weight_ = 0;
};

}  // namespace voxdag::color
