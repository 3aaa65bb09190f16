// The views from the corners of a tile's blocks (core/geometry/solid_rule.h). Not thread-safe.
#pragma once

#include <cstdint>

#include "core/backend/cpu/solid/running_rows.h"
#include "core/geometry/row_crossings.h"

namespace voxdag::cpu {

class TileViews {
 public:
  static constexpr int kCorners = RunningRows::kRows;  // maximum number of corners along an edge

  // Starts a tile.
  void begin(const SampleRows& rows);
  // Adds the crossings of a triangle with the tile's sample rows.
  void add(const FixedTriangle& triangle);
  // Sets the views of all corners from the views in `running`, which are at the tile's low faces,
  // and from the added crossings. Advances the views in `running` to the tile's high faces. `tile`
  // is the tile's position in the subvolume, in tiles.
  void finish(SolidRule rule, RunningRows& running, const int (&tile)[3]);

  // Returns the sum of the three views from a corner; coordinates are in blocks.
  int32_t at(int x, int y, int z) const { return views_[x][y][z]; }
  // Returns the class of a corner. `views`: the sum of its three views. If all corners of a unit
  // have the same class, each of them alone decides as the unit does, also whether it is disputed.
  //
  //   0                     |views| <= 3: outside
  //   views                 otherwise, if `views` is a multiple of 6: inside, not disputed
  //   6 k + 4, or -6 k - 4  otherwise, with 6 k < |views| < 6 k + 6: inside and disputed
  static int32_t class_of(int32_t views) {
    const int32_t size = views < 0 ? -views : views;
    const int32_t part = size % 6;
    const int32_t inside = part == 0 ? size : size - part + 4;
    return size <= 3 ? 0 : views < 0 ? -inside : inside;
  }
  // Sets `classes` to class_of() of the eight corners of a block, in the order of child indices.
  void classes_at(const int (&low)[3], int32_t (&classes)[8]) const {
    at_corners(low, classes);
    for (int32_t& views : classes) views = class_of(views);
  }
  // Sets `views` to at() of the eight corners of a block, in the order of child indices.
  void at_corners(const int (&low)[3], int32_t (&views)[8]) const {
    for (int c = 0; c < 8; ++c)
      views[c] = at(low[0] + (c >> 2), low[1] + (c >> 1 & 1), low[2] + (c & 1));
  }
  // Returns the views from the corners of a cube; `low` and `edge` are in blocks.
  UnitViews corners_of(const int (&low)[3], int edge) const;

 private:
  // Adds the views along an axis, which are in `rows`, to the sums of the corners that are at
  // position k along this axis.
  void add_views(int axis, int k, const int32_t* rows);

  SampleRows rows_;
  bool has_crossings_[3] = {};
  // crossings_[axis][k][row] is the sum of the signs of the row's crossings between its corners k
  // and k + 1.
  int32_t crossings_[3][8][RunningRows::kSquare] = {};
  int32_t views_[kCorners][kCorners][kCorners];
};

}  // namespace voxdag::cpu
