// The box around what is set.
#pragma once

#include <vector>

#include "query/dag_view.h"
#include "query/vec.h"

namespace voxdag::query {

struct Box {
  Vec low, high;
  Vec center() const { return mix(low, high, 0.5); }
  double diagonal() const { return length(high - low); }
};

// Exact to a 2048th of the grid, in voxels, the cells at its sides included. The view must not be
// empty.
Box occupied_box(const DagView& dag);

// The middles of the occupied cells of a 64th of the grid.
std::vector<Vec> occupied_points(const DagView& dag);

// The points without those few of thousands that lie far from all others, such as a speck that the
// scene's maker forgot.
std::vector<Vec> without_strays(const std::vector<Vec>& points);

}  // namespace voxdag::query
