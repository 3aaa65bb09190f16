// The sample rows of a column of subvolumes along an axis. core/geometry/solid_rule.h defines
// sample rows, blocks and views.
//
// The square of a cube is its projection along the axis. The column's square is the square of its
// largest subvolume and contains the squares of the other subvolumes. The rows are stored by tiles
// of the square. Each tile has the rows on all its borders. So a row on a border of tiles has a
// copy in each of these tiles, and advance() changes only the copies in the subvolume's tiles. A
// crossing on a border is in the subvolumes on both sides, so all copies of a row have the same
// total.
//
// Subvolumes and empty cubes are visited in Morton order. In this order everything in front of a
// cube, seen along any axis, comes before the cube.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/geometry/cube.h"
#include "core/geometry/solid_rule.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/solid/solid_rows.h"

namespace voxdag {

// Converts positions on the grid to tiles. A tile is a cube of 64^3 voxels, or the grid if the grid
// is smaller.
struct TileGrid {
  explicit TileGrid(uint32_t grid_levels);
  int tiles_along(const Cube& cube) const { return 1 << (levels - cube.level); }
  int low(const Cube& cube, int axis) const {
    return static_cast<int>(cube.position[axis] << (levels - cube.level));
  }

  uint32_t levels;  // level of a tile
  int blocks;       // blocks along a tile's edge, at most 8
};

// The sample rows through a tile's square or along its border: their crossings outside the grid.
struct OutsideTile {
  int32_t before[81] = {};  // sums of the signs of the crossings in front of the grid
  int32_t total[81] = {};   // numbers (row_sums.h) of all crossings outside the grid
};

class RowColumn {
 public:
  static constexpr int kRows = 9;
  static constexpr int kSquare = kRows * kRows;

  // `square`: the largest subvolume of the column; its square is the column's square. Charges the
  // column's memory to `budget`.
  RowColumn(const TileGrid& grid, SolidRule rule, int axis, const Cube& square,
            MemoryBudget& budget);
  static uint64_t bytes(const TileGrid& grid, const Cube& square);

  // Call the functions in this order: add_total() for all subvolumes of the column, and
  // add_outside(); then begin(); then entry() and advance() for each subvolume in Morton order.
  void add_total(const Cube& cube, const std::vector<int32_t>& numbers);
  // Adds the column's rows to `counts`; each row of the grid counts once. Call it before begin().
  void count(RowCounts& counts) const;
  // Adds the rows of one tile to `counts`. number(i) returns the number (row_sums.h) of row i of
  // the tile.
  template <class Number>
  static void count_tile(const TileGrid& grid, int first, int second, Number number,
                         RowCounts& counts);
  void begin();
  // Adds the crossings of a tile's rows outside the grid. Call it before begin().
  void add_outside(int first, int second, const OutsideTile& outside);
  // Sets `views` to the views from the subvolume's low face.
  void entry(const Cube& cube, std::vector<int32_t>& views) const;
  void advance(const Cube& cube, const std::vector<int32_t>& numbers);
  // Returns the view from corner `c` of an empty cube. Call it after advance() of all subvolumes
  // before the cube in Morton order.
  int32_t corner(const Cube& cube, int c) const;

 private:
  // Calls visit(i, at) for each row of the cube. `i` is the row's index in the cube's vector
  // (`numbers` or `views`), and `at` is its index in the vectors of this column.
  template <class Visit>
  void for_each_row(const Cube& cube, Visit visit) const;
  size_t tile_index(int first, int second) const;

  const TileGrid grid_;
  const SolidRule rule_;
  const int first_axis_, second_axis_;
  const int first_low_, second_low_;  // low corner of the column's square, in tiles
  const int tiles_;
  const MemoryCharge charge_;
  std::vector<int32_t> totals_;  // the rows' totals; after begin(), the current views
  std::vector<bool> crossed_;
  std::vector<int32_t> before_;  // crossings in front of the grid; empty if no row has any
};

template <class Number>
void RowColumn::count_tile(const TileGrid& grid, int first, int second, Number number,
                           RowCounts& counts) {
  // The rows on a tile's high borders belong to the next tile, or to this one if it is the last.
  const int last = (1 << grid.levels) - 1;
  const int rows_f = grid.blocks + (first == last ? 1 : 0);
  const int rows_s = grid.blocks + (second == last ? 1 : 0);
  for (int i = 0; i < rows_f; ++i)
    for (int j = 0; j < rows_s; ++j) {
      const int32_t row = number(kRows * i + j);
      counts.rows += has_crossing(row) ? 1 : 0;
      counts.open += row_sum(row) != 0 ? 1 : 0;
      counts.odd += row_sum(row) & 1;
    }
}

}  // namespace voxdag
