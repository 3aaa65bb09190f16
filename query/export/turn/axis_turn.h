// Rotations of a grid by 90 degrees around the x axis, for exports in which another axis points up.
// A rotation maps the grid to itself and octree cubes to octree cubes, so the levels of a DAG keep
// their numbers of nodes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "voxdag/cells.h"

namespace voxdag::query {

// A rotation. Axis a of the turned grid is axis from[a] of the file's grid. If reversed[a] is true,
// the two axes have opposite directions.
struct AxisTurn {
  std::array<uint8_t, 3> from = {0, 1, 2};
  std::array<bool, 3> reversed = {};

  bool is_none() const { return from[1] == 1; }
  // Converts a cell from the file's axes to the turned axes. `edge` is the number of cells per edge
  // of the grid.
  Position turned(const Position& cell, int64_t edge) const {
    Position result;
    for (size_t a = 0; a < 3; ++a)
      result[a] = reversed[a] ? edge - 1 - cell[from[a]] : cell[from[a]];
    return result;
  }
  // The inverse of turned().
  Position original(const Position& cell, int64_t edge) const {
    Position result{};
    for (size_t a = 0; a < 3; ++a) result[from[a]] = reversed[a] ? edge - 1 - cell[a] : cell[a];
    return result;
  }
  Region turned(const Region& region, int64_t edge) const {
    Region result;
    for (size_t a = 0; a < 3; ++a) {
      result.low[a] = reversed[a] ? edge - region.high[from[a]] : region.low[from[a]];
      result.high[a] = reversed[a] ? edge - region.low[from[a]] : region.high[from[a]];
    }
    return result;
  }
  Region original(const Region& region, int64_t edge) const {
    Region result;
    for (size_t a = 0; a < 3; ++a) {
      result.low[from[a]] = reversed[a] ? edge - region.high[a] : region.low[a];
      result.high[from[a]] = reversed[a] ? edge - region.low[a] : region.high[a];
    }
    return result;
  }
  // Returns the index that a child of a node has after the rotation. The child at (x, y, z) has the
  // index 4x + 2y + z.
  int turned_child(int child) const {
    const Position at = turned(Position{child >> 2, child >> 1 & 1, child & 1}, 2);
    return static_cast<int>(4 * at[0] + 2 * at[1] + at[2]);
  }
};

// Maps (x, y, z) to (x, -z, y). The y axis of the file then points along z.
constexpr AxisTurn kTurnYToZ = {{0, 2, 1}, {false, true, false}};
// Maps (x, y, z) to (x, z, -y). The z axis of the file then points along y.
constexpr AxisTurn kTurnZToY = {{0, 2, 1}, {false, false, true}};

}  // namespace voxdag::query
