// Iterates over the bricks of a selection. The selection's grid is the file's grid or a coarser
// grid; a brick of a coarser grid has 4x4x4 cells of that grid. Box queries, lists of positions and
// exporters use this iteration. Its memory is constant; its time grows with the number of bricks in
// the selection.
#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

#include "core/dag/brick.h"
#include "query/dag/dag_view.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Returns the position of the cell that bit `bit` of a brick's mask stands for.
inline Position brick_cell(const Brick& brick, int bit) {
  return {brick.low[0] + brick_coordinate(bit, 0), brick.low[1] + brick_coordinate(bit, 1),
          brick.low[2] + brick_coordinate(bit, 2)};
}

// Calls visit(cell) for each cell of a brick, in Morton order.
template <class Visit>
void for_each_cell_of(Brick brick, const Visit& visit) {
  for (; brick.mask != 0; brick.mask &= brick.mask - 1)
    visit(brick_cell(brick, std::countr_zero(brick.mask)));
}

// Returns the low corner of a cube's child `index`. `corner` is the cube's low corner, `edge` the
// children's edge.
inline Position child_corner(const Position& corner, int index, int64_t edge) {
  return {corner[0] + (index & 4 ? edge : 0), corner[1] + (index & 2 ? edge : 0),
          corner[2] + (index & 1 ? edge : 0)};
}

// Returns a mask of the cells of a brick that are in the region. `low` is the brick's low corner.
uint64_t mask_within(const Region& region, const Position& low);

// Throws Error{kInvalidInput} unless 0 <= grid_levels <= the file's levels.
void check_grid_levels(const DagView& dag, uint32_t grid_levels);

// `depth` and `content` (dag_view.h) identify an octree cube. True if all cells in this cube are
// set. The cells are the cells of the grid of 2^grid_levels cells per edge.
bool is_full(const DagView& dag, uint32_t depth, uint64_t content, uint32_t grid_levels);

// The implementation of for_each_brick() and for_each_brick_or_full_cube().
template <class Visit>
class BrickWalk {
 public:
  BrickWalk(const DagView& dag, const Selection& selection, Visit& visit)
      : dag_(dag), selection_(selection), visit_(visit) {}

  void run() {
    const Position origin = {0, 0, 0};
    if (dag_.empty() || selection_.region.empty()) return;
    if (selection_.grid_levels >= kBrickLevels)
      enter(0, origin, dag_.root());
    else  // a grid of one or two cells per edge is smaller than one brick
      brick(origin, selection_.grid_levels == 0 ? 1 : dag_.children(0, dag_.root()).mask);
  }

 private:
  // Visits an octree cube (dag_view.h). Returns false if the visitor has ended the walk.
  bool enter(uint32_t depth, const Position& low, uint64_t content) {
    if (depth + kBrickLevels == selection_.grid_levels)
      return brick(low, brick_of_cells(dag_, depth, content));
    if constexpr (requires { visit_.full_cube(low, int64_t{1}); }) {
      const int64_t edge = int64_t{1} << (selection_.grid_levels - depth);
      if (selection_.region.contains(low, edge) &&
          is_full(dag_, depth, content, selection_.grid_levels))
        return visit([&] { return visit_.full_cube(low, edge); });
    }
    const DagView::Children children = dag_.children(depth, content);
    const int64_t half = int64_t{1} << (selection_.grid_levels - depth - 1);
    for (int i = 0; i < 8; ++i) {
      if (!children.has(i)) continue;
      const Position corner = child_corner(low, i, half);
      if (selection_.region.intersects(corner, half) &&
          !enter(depth + 1, corner, dag_.content(depth, children, i)))
        return false;
    }
    return true;
  }

  bool brick(const Position& low, uint64_t mask) {
    if (!selection_.region.contains(low, kBrickEdge)) mask &= mask_within(selection_.region, low);
    if (mask == 0) return true;
    return visit([&] { return visit_(Brick{low, mask}); });
  }

  template <class Call>
  static bool visit(const Call& call) {
    if constexpr (std::is_void_v<std::invoke_result_t<Call>>) {
      call();
      return true;
    } else {
      return call();
    }
  }

  const DagView& dag_;
  const Selection& selection_;
  Visit& visit_;
};

// Calls visit(const Brick&) for every brick that has set cells in the region, in Morton order. If
// visit() returns a bool, false ends the iteration. The brick's mask has only the cells in the
// region; the region may extend beyond the grid. A node is read once for each place where it occurs
// in the selection. Throws Error{kInvalidInput} if the selection's grid has more levels than the
// file, and Error{kCorrupt} for a damaged DAG.
template <class Visit>
void for_each_brick(const DagView& dag, const Selection& selection, Visit&& visit) {
  check_grid_levels(dag, selection.grid_levels);
  BrickWalk<std::remove_reference_t<Visit>>(dag, selection, visit).run();
}

// Like for_each_brick(), but visits a large full cube in one step. A full cube is an octree cube in
// which all cells are set; solids have many. Calls visit_cube(low, edge) for each of the largest
// full cubes that are completely in the region and have at least 8 cells per edge. Calls
// visit_brick(brick) for all other bricks. Both functions are called in Morton order; if they
// return a bool, false ends the iteration.
template <class VisitBrick, class VisitCube>
void for_each_brick_or_full_cube(const DagView& dag, const Selection& selection,
                                 const VisitBrick& visit_brick, const VisitCube& visit_cube) {
  struct Visitor {
    const VisitBrick& visit_brick;
    const VisitCube& visit_cube;
    auto operator()(const Brick& brick) const { return visit_brick(brick); }
    auto full_cube(const Position& low, int64_t edge) const { return visit_cube(low, edge); }
  };
  for_each_brick(dag, selection, Visitor{visit_brick, visit_cube});
}

// Returns the number of cells of a cube.
constexpr uint64_t cells_of_cube(int64_t edge) {
  return static_cast<uint64_t>(edge) * static_cast<uint64_t>(edge) * static_cast<uint64_t>(edge);
}

}  // namespace voxdag::query
