// The box of a region's cells: which cells of the color grid are in the region, and their Morton
// codes in the region.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/color_grid.h"
#include "core/color/rule/touched_cells.h"
#include "core/geometry/cube.h"
#include "core/geometry/morton.h"
#include "core/geometry/octree_descent.h"

namespace voxdag::color {

class RegionBox {
 public:
  explicit RegionBox(const ColorGrid& grid) : grid_(grid) {
    for (int a = 0; a < 3; ++a)
      for (uint32_t k = 0; k < 64; ++k)
        spread_[a][k] = static_cast<uint32_t>(spread_bits3(k) << (2 - a));
  }

  // Moves the box to `region`, a cube of at most 64^3 color cells.
  void move_to(const Cube& region) {
    const uint32_t down = grid_.color_levels - region.level;
    for (int a = 0; a < 3; ++a) {
      first_[a] = static_cast<int64_t>(region.position[a]) << down;
      last_[a] = first_[a] + (int64_t{1} << down) - 1;
    }
  }

  // Returns the position of the region's first cell along an axis.
  int64_t first(int axis) const { return first_[axis]; }

  // Returns the cells of the color grid that the bounding box of a triangle touches.
  CellBox cells_of(const FixedTriangle& triangle) const {
    return CellBox(triangle, grid_.levels, grid_.color_levels);
  }
  bool overlaps(const CellBox& cells) const {
    for (int a = 0; a < 3; ++a)
      if (cells.high[a] < first_[a] || cells.low[a] > last_[a]) return false;
    return true;
  }
  // True if the triangle is in a single cell and cannot cover a column, which is the case for most
  // tiny triangles. `cells` is the result of cells_of().
  bool is_tiny(const FixedTriangle& triangle, const CellBox& cells) const {
    return cells.low[0] == cells.high[0] && cells.low[1] == cells.high[1] &&
           cells.low[2] == cells.high[2] && !may_cover(triangle);
  }

  // Calls visit(cell, columns, code) for each cell of the region that the triangle touches.
  // `columns` is the set of the columns that the triangle covers (columns.h), and `code` is the
  // cell's Morton code in the region. cell[0], cell[1] and cell[2] are the position of the cell
  // along the axes of `triangle`. `cells` is the result of cells_of().
  template <class Int, class Visit>
  void visit(const CellTriangle<Int>& triangle, const CellBox& cells, const Visit& visit) const {
    CellRange range;
    const uint32_t* spread[3];
    int64_t low[3];
    for (int d = 0; d < 3; ++d) {
      const int a = triangle.axis[d];
      range.first[d] = std::max(cells.low[a], first_[a]);
      range.last[d] = std::min(cells.high[a], last_[a]);
      spread[d] = spread_[a];
      low[d] = first_[a];
    }
    TouchedCells<Int>(triangle, range)
        .visit([&](int64_t p, int64_t q, int64_t r, uint32_t columns) {
          visit({p, q, r}, columns,
                spread[0][p - low[0]] | spread[1][q - low[1]] | spread[2][r - low[2]]);
        });
  }

  // Returns the Morton code, in the region, of the cell at a position of the color grid.
  uint32_t code_of(const int64_t (&position)[3]) const {
    return spread_[0][position[0] - first_[0]] | spread_[1][position[1] - first_[1]] |
           spread_[2][position[2] - first_[2]];
  }
  // Returns the center of a cell in lattice units (1/256 voxel).
  std::array<int64_t, 3> center_of(uint32_t code) const {
    uint32_t at[3];
    morton_decode(code, at[0], at[1], at[2]);
    std::array<int64_t, 3> center;
    for (size_t a = 0; a < 3; ++a)
      center[a] = (2 * (first_[a] + at[a]) + 1) << (grid_.cell_bits() - 1);
    return center;
  }

 private:
  // Returns false if the triangle cannot cover a column. A column is a line with fixed coordinates
  // along two axes. So along at least two axes, the triangle's box must contain a coordinate of a
  // column.
  bool may_cover(const FixedTriangle& triangle) const {
    const int bits = grid_.cell_bits() - 2;
    const int64_t half = int64_t{1} << (bits - 1);
    int axes = 0;
    for (int a = 0; a < 3; ++a)
      axes += (triangle.low(a) + half - 1) >> bits != (triangle.high(a) + half) >> bits;
    return axes >= 2;
  }

  const ColorGrid grid_;
  uint32_t spread_[3][64];  // [axis][coordinate]: the coordinate's bits in a Morton code
  int64_t first_[3] = {}, last_[3] = {};  // range of the region's cells, by axis
};

}  // namespace voxdag::color
