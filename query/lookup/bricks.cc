#include "query/lookup/bricks.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

// Masks of cells in a brick. A cell's coordinate on an axis is 0 to 3, so it has two bits.
// kUpper[axis][b] has the cells for which bit b of the coordinate on `axis` is set.
constexpr uint64_t kUpper[3][2] = {{0xf0f0f0f0f0f0f0f0ull, 0xffffffff00000000ull},
                                   {0xccccccccccccccccull, 0xffff0000ffff0000ull},
                                   {0xaaaaaaaaaaaaaaaaull, 0xff00ff00ff00ff00ull}};

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
    throw Error(ErrorCode::kInvalidInput, "the selected grid has 2^" + std::to_string(grid_levels) +
                                              " cells per edge, expected at most 2^" +
                                              std::to_string(dag.grid_levels()));
}

bool is_full(const DagView& dag, uint32_t depth, uint64_t content, uint32_t grid_levels) {
  if (depth == grid_levels) return true;
  const bool is_brick = depth + kBrickLevels == dag.grid_levels();
  if (is_brick && grid_levels == dag.grid_levels()) return content == ~uint64_t{0};
  const DagView::Children children = dag.children(depth, content);
  if (children.mask != 255) return false;
  if (depth + 1 == grid_levels) return true;
  uint64_t before = 0;  // content of the previous child, which is full; equal children are skipped
  for (int i = 0; i < 8; ++i) {
    const uint64_t child = dag.content(depth, children, i);
    if (i > 0 && child == before) continue;
    if (!is_full(dag, depth + 1, child, grid_levels)) return false;
    before = child;
  }
  return true;
}

}  // namespace voxdag::query
