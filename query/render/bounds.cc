#include "query/render/bounds.h"

#include <algorithm>

namespace voxdag::query {

Box occupied_box(const DagView& dag) {
  Box box{{{1e30, 1e30, 1e30}}, {}};
  const auto reaches_out = [&](const DagView::Cell& cell) {
    for (int axis = 0; axis < 3; ++axis)
      if (cell.low[axis] < box.low[axis] || cell.low[axis] + cell.edge > box.high[axis])
        return 0xffu;
    return 0u;
  };
  dag.for_each_cell(std::min(dag.grid_levels(), 11u), reaches_out, [&](const DagView::Cell& cell) {
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], cell.low[axis]);
      box.high[axis] = std::max(box.high[axis], cell.low[axis] + cell.edge);
    }
  });
  return box;
}

std::vector<Vec> occupied_points(const DagView& dag) {
  std::vector<Vec> points;
  const auto everywhere = [](const DagView::Cell&) { return 0xffu; };
  dag.for_each_cell(std::min(dag.grid_levels(), 6u), everywhere, [&](const DagView::Cell& cell) {
    const double half = cell.edge / 2;
    points.push_back(cell.low + Vec{{half, half, half}});
  });
  return points;
}

}  // namespace voxdag::query
