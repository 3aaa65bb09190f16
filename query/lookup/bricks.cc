#include "query/lookup/bricks.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

// The cells of a brick whose coordinate on an axis has the given low or high bit.
constexpr uint64_t kUpper[3][2] = {{0xf0f0f0f0f0f0f0f0ull, 0xffffffff00000000ull},
                                   {0xccccccccccccccccull, 0xffff0000ffff0000ull},
                                   {0xaaaaaaaaaaaaaaaaull, 0xff00ff00ff00ff00ull}};

class BrickWalk {
 public:
  BrickWalk(const DagView& dag, const Selection& selection,
            const std::function<void(const Brick&)>& visit)
      : dag_(dag), selection_(selection), visit_(visit) {}

  void run() {
    if (dag_.empty() || selection_.region.empty()) return;
    const Position origin = {0, 0, 0};
    if (selection_.grid_levels >= 2) return enter(0, origin, dag_.root());
    // A grid of one or two cells per edge is part of one brick.
    brick(origin, selection_.grid_levels == 0 ? 1 : dag_.children(0, dag_.root()).mask);
  }

 private:
  void enter(uint32_t depth, const Position& low, uint64_t content) {
    if (depth + 2 == selection_.grid_levels)
      return brick(low, brick_of_cells(dag_, depth, content));
    const DagView::Children children = dag_.children(depth, content);
    const int64_t half = int64_t{1} << (selection_.grid_levels - depth - 1);
    for (int i = 0; i < 8; ++i) {
      if (!children.has(i)) continue;
      const Position corner = {low[0] + (i & 4 ? half : 0), low[1] + (i & 2 ? half : 0),
                               low[2] + (i & 1 ? half : 0)};
      if (selection_.region.intersects(corner, half))
        enter(depth + 1, corner, dag_.content(depth, children, i));
    }
  }

  void brick(const Position& low, uint64_t mask) const {
    mask &= mask_within(selection_.region, low);
    if (mask != 0) visit_({low, mask});
  }

  const DagView& dag_;
  const Selection& selection_;
  const std::function<void(const Brick&)>& visit_;
};

}  // namespace

uint64_t mask_within(const Region& region, const Position& low) {
  uint64_t mask = ~uint64_t{0};
  for (size_t axis = 0; axis < 3; ++axis) {
    if (region.low[axis] <= low[axis] && low[axis] + 4 <= region.high[axis]) continue;
    uint64_t slabs = 0;
    for (int64_t i = 0; i < 4; ++i)
      if (region.low[axis] <= low[axis] + i && low[axis] + i < region.high[axis])
        slabs |= (i & 1 ? kUpper[axis][0] : ~kUpper[axis][0]) &
                 (i & 2 ? kUpper[axis][1] : ~kUpper[axis][1]);
    mask &= slabs;
  }
  return mask;
}

void check_grid_levels(const DagView& dag, uint32_t grid_levels) {
  if (grid_levels > dag.grid_levels())
    throw Error(ErrorCode::kInvalidInput, "a grid of 2^" + std::to_string(grid_levels) +
                                              " cells per edge, expected at most 2^" +
                                              std::to_string(dag.grid_levels()));
}

void for_each_brick(const DagView& dag, const Selection& selection,
                    const std::function<void(const Brick&)>& visit) {
  check_grid_levels(dag, selection.grid_levels);
  BrickWalk(dag, selection, visit).run();
}

}  // namespace voxdag::query
