// Looks up which points of a grid are set.
#pragma once

#include <cstdint>
#include <span>

#include "query/dag/dag_view.h"
#include "query/lookup/top_cells.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Sets set[i] to 1 if the cell points[i] of the grid of 2^grid_levels cells per edge contains a set
// voxel; to 0 if it contains none or is outside the grid. A lookup descends the DAG from the root
// to the cell. Many descents run interleaved, because each of them waits for memory at every level.
// If `top` is not null, descents begin at its nodes instead of the root. The spans must have equal
// lengths, less than 2^32. grid_levels must be at most the number of levels of the file's grid.
// Throws Error{kCorrupt} for a damaged DAG.
void look_up(const DagView& dag, const TopCells* top, uint32_t grid_levels,
             std::span<const Position> points, std::span<uint8_t> set);

}  // namespace voxdag::query
