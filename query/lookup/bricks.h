// Bricks of a part of a file, in the grid of any of its octree's levels: what boxes, lists of
// positions and exporters are made from.
#pragma once

#include <cstdint>
#include <functional>

#include "query/dag_view.h"
#include "query/lookup/position.h"
#include "query/selection.h"

namespace voxdag::query {

// 4x4x4 cells of the selected grid. The bits of the mask are those of the file's bricks, see
// brick_cell().
struct Brick {
  Position low;  // of its low corner, a multiple of 4, in cells
  uint64_t mask;
};

// The cell of a bit of a brick's mask: bit = 32x1 + 16y1 + 8z1 + 4x0 + 2y0 + z0.
inline Position brick_cell(const Brick& brick, int bit) {
  return {brick.low[0] + (bit >> 4 & 2) + (bit >> 2 & 1),
          brick.low[1] + (bit >> 3 & 2) + (bit >> 1 & 1),
          brick.low[2] + (bit >> 2 & 2) + (bit & 1)};
}

// Calls `visit` for every brick that has set cells in the region, in Morton order; the mask is cut
// to the region. What lies outside the region, or outside the grid, is not visited; no node above a
// brick is read twice for it. Throws Error{kInvalidInput} unless the selection's grid has at most
// the file's levels, and Error{kCorrupt} for a damaged DAG.
void for_each_brick(const DagView& dag, const Selection& selection,
                    const std::function<void(const Brick&)>& visit);

// The cells of a brick at `low` that lie in the region.
uint64_t mask_within(const Region& region, const Position& low);

// Throws Error{kInvalidInput} unless 0 <= grid_levels <= those of the file.
void check_grid_levels(const DagView& dag, uint32_t grid_levels);

}  // namespace voxdag::query
