// The running views of a subvolume's sample rows (core/geometry/solid_rule.h).
//
// A walk over tiles in octree order reaches a tile after all tiles with a smaller x and the same y
// and z, and likewise along y and z. So one number per row is enough: the row's view at the low
// face of the next tile of its column. The cross section of a column of tiles along an axis is a
// square. The column has the rows through the square and on the square's borders. If two columns
// share a border, each has its own copy of the border's rows. Not thread-safe.
#pragma once

#include <cstdint>

#include "core/dag/consing/pooled_memory.h"
#include "core/geometry/solid_rule.h"

namespace voxdag::cpu {

class RunningRows {
 public:
  static constexpr int kRows = 9;  // maximum number of rows along an edge of a column's square
  static constexpr int kSquare = kRows * kRows;

  // `tiles`: number of tiles along the subvolume's edge. `blocks`: number of blocks along a tile's
  // edge, at most 8. `entry` has the views at the subvolume's low faces. Throws OutOfBudget.
  RunningRows(PooledMemory& memory, const SolidEntry& entry, int tiles, int blocks);

  // Returns the views along `axis` at the low face of a column's next tile. `tile`: the position of
  // any tile of the column, in tiles. The view of row (i, j) is at index kRows * i + j.
  int32_t* column(int axis, const int (&tile)[3]) {
    return &views_[((axis * tiles_ + tile[first_row_axis(axis)]) * tiles_ +
                    tile[second_row_axis(axis)]) *
                   size_t{kSquare}];
  }
  // Returns the views from the corners of a cube that no triangle touches. `low` and `edge` are in
  // tiles. Call it when all tiles up to the cube's last tile (in octree order) have been processed,
  // and before a later tile is processed.
  UnitViews corners_of(const int (&low)[3], int edge);

 private:
  const size_t tiles_;
  const int blocks_;
  PooledArray<int32_t> views_;  // [axis][column][row]
};

}  // namespace voxdag::cpu
