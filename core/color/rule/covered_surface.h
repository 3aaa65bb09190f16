// Computes the weight of a triangle in a cell in which it covers columns (cell_triangle.h), and the
// mean of the triangle's points on these columns.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/columns.h"
#include "core/color/rule/surface_look.h"
#include "core/color/samples/sample_batch.h"

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

// Returns 1.0 / count, for a count from 1 to 16.
VOXDAG_HD inline double reciprocal_of(int64_t count) {
  static constexpr Reciprocals kReciprocals{};
  return kReciprocals.of[count];
}

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

  // Sets the members of `out` for cells whose p is from first_p to first_p + 63, and whose q is
  // from first_q to first_q + 63: the coordinates P and Q of columns are then relative to the
  // columns 4 first_p and 4 first_q. Returns false if the sums may need more than the 53 bits of a
  // double.
  bool describe(int64_t first_p, int64_t first_q, SampledSurface& out) const {
    if (sizeof(Int) > sizeof(int64_t)) return false;
    // The sums of P and of Q over the columns of a cell are below 16 * 4 * 64 = 2^12.
    constexpr Int kLargest = Int{1} << 39, kLargestSum = Int{1} << 47;
    for (int i = 0; i < 2; ++i) {
      const int edge = i == 0 ? 2 : 0;  // opposite to vertex 1, and opposite to vertex 2
      const Int terms[3] = {sum_of(edge, 1, 0, 0), sum_of(edge, 0, 1, 0),
                            sum_of(edge, 4 * first_p, 4 * first_q, 1)};
      for (int k = 0; k < 3; ++k) {
        if (magnitude(terms[k]) >= (k < 2 ? kLargest : kLargestSum)) return false;
        out.edges[i][k] = to_double(terms[k]);
      }
    }
    out.scale = scale_;
    out.column_weight = column_weight_;
    return true;
  }

  // Returns the mean point of the covered columns of a cell. At least one column must be covered.
  VOXDAG_HD SurfacePoint mean_point(int64_t p, int64_t q, const ColumnTotals& totals) const {
    const Int sum_p = 4 * p * totals.count + totals.sum_i;
    const Int sum_q = 4 * q * totals.count + totals.sum_j;
    const double share = reciprocal_of(totals.count);
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
