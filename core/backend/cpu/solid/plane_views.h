// The views (core/geometry/solid_rule.h) on both sides of a triangle's plane in a tile. The
// triangle covers the tile (triangle_set.h) and is the only triangle in it. If all corners of
// blocks on the same side of the plane have equal views, the plane and its inner sides (plane.h)
// determine the tile's voxels, so the tile's node can be in the plane memo. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>

#include "core/backend/cpu/memo/plane.h"
#include "core/backend/cpu/solid/running_rows.h"
#include "core/backend/cpu/solid/tile_views.h"

namespace voxdag::cpu {

class PlaneViews {
 public:
  // The plane's inner sides, and whether the views along different axes disagree about the voxels
  // of these sides (UnitViews::is_disputed()).
  struct Sides {
    InnerSides inner;
    bool is_disputed;
  };

  PlaneViews(SolidRule rule, RunningRows& running) : rule_(rule), running_(running) {}

  // Reads the views at the low faces of a tile of 64^3 voxels. `f`: the plane's offset (plane.h)
  // from the tile. `is_turned`: the triangle's normal is opposite to the plane's. Returns nullopt
  // if views of one side differ, or if both sides are inside the solid but only one of them is
  // disputed.
  std::optional<Sides> read(const Plane& plane, int64_t f, bool is_turned, const int (&tile)[3]);
  // Returns the plane's inner sides in a cube within a tile, from the views at the corners of the
  // cube's blocks. The triangle covers the cube and is the only triangle in it. `f`: the plane's
  // offset from the cube. `low` and `edge`: the cube in the tile, in blocks. Returns nullopt if
  // views of one side have different classes (TileViews::class_of()), and otherwise as read() does.
  static std::optional<Sides> read_part(const TileViews& views, const Plane& plane, int64_t f,
                                        const int (&low)[3], int edge);
  // Advances the views to the high faces of the tile of the last read().
  void advance();

 private:
  static constexpr int kRows = RunningRows::kRows;

  // The plane's values at the corners of blocks on one face of the tile. `base` is the value at the
  // face's first corner. A corner is above the plane iff its value is >= 0.
  struct Face {
    int64_t base, first_step, second_step;

    int64_t at(int i, int j) const { return base + i * first_step + j * second_step; }
    bool has(bool is_above) const;
  };
  Face face(int axis, bool is_high) const;
  bool read(int axis, bool is_turned);

  const SolidRule rule_;
  RunningRows& running_;
  int64_t base_ = 0;      // the plane's value at the tile's low corner
  int64_t step_[3] = {};  // differences of the plane's values at adjacent corners, by axis
  int32_t* rows_[3] = {};
  int32_t views_[3][2] = {};  // [axis][is above]
};

}  // namespace voxdag::cpu
