// Finds the set cell that is nearest to a point.
#pragma once

#include <array>
#include <cstdint>

#include "core/geometry/cube.h"
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

// Finds the nearest cells of many cells that are close to each other, and the cells that it finds
// are close too. A search begins in the smallest cube that contains all cells that are near enough,
// and the nodes above this cube are kept for the next search. Not thread-safe.
class NearestFinder {
 public:
  // `dag` must not be empty, and must outlive this object.
  NearestFinder(const DagView& dag, uint32_t grid_levels) : dag_(dag), grid_levels_(grid_levels) {
    contents_[0] = dag.root();
  }
  // Like find_nearest(), if there is a set cell at a distance of at most `reach` on each axis.
  // `from` is inside of the grid.
  Nearest find(const Position& from, uint32_t reach);

 private:
  bool descend(const Position& to, uint32_t depth);

  const DagView& dag_;
  const uint32_t grid_levels_;
  // The contents of the cubes that contain the cell `at_`, from the root down to `depth_`.
  Position at_ = {0, 0, 0};
  uint32_t depth_ = 0;
  std::array<uint64_t, kMaxGridLevels + 1> contents_;
};

}  // namespace voxdag::query
