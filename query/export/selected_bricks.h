// The selected cells of a DAG as bricks of 4^3 cells, in Morton order. Memory does not grow with
// the selection, time does with its bricks.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>

#include "core/dag/brick.h"
#include "query/dag_view.h"
#include "query/selection.h"

namespace voxdag::query {

using CellCorner = std::array<int64_t, 3>;

// The corner of child `index` of a cube, whose children have that edge.
inline CellCorner child_corner(const CellCorner& corner, int index, int64_t edge) {
  return {corner[0] + (index & 4 ? edge : 0), corner[1] + (index & 2 ? edge : 0),
          corner[2] + (index & 1 ? edge : 0)};
}

// Those cells of a brick that lie in the region.
inline uint64_t clipped_brick(uint64_t mask, const CellCorner& corner, const Region& region) {
  if (region.contains(corner, kBrickEdge)) return mask;
  for (int bit = 0; bit < 64; ++bit) {
    const CellCorner cell = {corner[0] + brick_coordinate(bit, 0),
                             corner[1] + brick_coordinate(bit, 1),
                             corner[2] + brick_coordinate(bit, 2)};
    if (!region.contains(cell, 1)) mask &= ~(uint64_t{1} << bit);
  }
  return mask;
}

// Calls visit(corner, mask) for each brick with selected cells, until it returns false.
template <class Visit>
class SelectedBricks {
 public:
  SelectedBricks(const DagView& dag, const Selection& selection, Visit& visit)
      : dag_(dag), selection_(selection), visit_(visit) {}
  bool run() { return dag_.empty() || below(0, dag_.root(), {0, 0, 0}); }

 private:
  bool below(uint32_t depth, uint64_t content, const CellCorner& corner) {
    const int64_t edge = int64_t{1} << (selection_.grid_levels - depth);
    if (!selection_.region.intersects(corner, edge)) return true;
    if (edge == kBrickEdge) {
      const uint64_t mask =
          clipped_brick(brick_of_cells(dag_, depth, content), corner, selection_.region);
      return mask == 0 || visit_(corner, mask);
    }
    const DagView::Children children = dag_.children(depth, content);
    for (int i = 0; i < 8; ++i)
      if (children.has(i) &&
          !below(depth + 1, dag_.content(depth, children, i), child_corner(corner, i, edge / 2)))
        return false;
    return true;
  }

  const DagView& dag_;
  const Selection& selection_;
  Visit& visit_;
};

template <class Visit>
void for_each_selected_brick(const DagView& dag, const Selection& selection, Visit&& visit) {
  SelectedBricks<std::remove_reference_t<Visit>>(dag, selection, visit).run();
}

// Calls visit(cell) for each cell of a brick, in Morton order.
template <class Visit>
void for_each_cell_of(const CellCorner& corner, uint64_t mask, const Visit& visit) {
  for (; mask != 0; mask &= mask - 1) {
    const int bit = std::countr_zero(mask);
    visit(CellCorner{corner[0] + brick_coordinate(bit, 0), corner[1] + brick_coordinate(bit, 1),
                     corner[2] + brick_coordinate(bit, 2)});
  }
}

}  // namespace voxdag::query
