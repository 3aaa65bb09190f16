// Where the occupied part of the grid lies, in voxels. The functions need a DAG that is not empty.
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

// The box around the occupied cells of 1/2048 of the grid's edge.
Box occupied_box(const DagView& dag);

// The centers of the occupied cells of 1/64 of the grid's edge.
std::vector<Vec> occupied_points(const DagView& dag);

}  // namespace voxdag::query
