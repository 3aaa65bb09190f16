// Finds the set cell that is nearest to a point.
#pragma once

#include <cstdint>

#include "query/dag/dag_view.h"
#include "voxdag/query.h"

namespace voxdag::query {

// Finds the set cell whose center is nearest to the center of the cell `from`, in the grid of
// 2^grid_levels cells per edge. If several cells are equally near, the result is the cell with the
// lowest Morton code. Finds nothing if the squared distance, in cells, exceeds max_squared.
// Descends into near children first, and never into children that are farther than the best cell so
// far. grid_levels must be at most the number of levels of the file's grid. The coordinates of
// `from` must be from -kMaxCoordinate to kMaxCoordinate. Throws Error{kCorrupt} for a damaged DAG.
Nearest find_nearest(const DagView& dag, uint32_t grid_levels, const Position& from,
                     uint64_t max_squared);

}  // namespace voxdag::query
