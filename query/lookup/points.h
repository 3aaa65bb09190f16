// Looks up which points of a grid are set.
#pragma once

#include <cstdint>
#include <span>

#include "query/dag/dag_view.h"
#include "query/lookup/top_cells.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Sets set[i] to 1 if cell points[i] of the grid of 2^grid_levels per edge has a set voxel; to 0 if
// it has none or is outside the grid. Many descents run interleaved, because each waits for memory
// at every level. They begin at the top cells, if given. The spans have equal lengths, less than
// 2^32, and grid_levels is at most the file's. Throws Error{kCorrupt} for a damaged DAG.
void look_up(const DagView& dag, const TopCells* top, uint32_t grid_levels,
             std::span<const Position> points, std::span<uint8_t> set);

}  // namespace voxdag::query
