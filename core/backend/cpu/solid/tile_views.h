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
  // Sets the classes of the eight corners of a block, in the order of child indices. The class of a
  // corner depends on the sum of its three views: 0 if the sum means outside, 4 or -4 if it means
  // inside and disputed, and otherwise the sum itself.
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
  static int32_t class_of(int32_t views) {
    const int32_t disputed = views < 0 ? -4 : 4;
    const int32_t inside = views > -6 && views < 6 ? disputed : views;
    return views >= -3 && views <= 3 ? 0 : inside;
  }
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
