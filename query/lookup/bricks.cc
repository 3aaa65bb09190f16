#include "query/lookup/bricks.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

// Masks of a brick. A cell's coordinate on an axis, 0 to 3, has two bits. kUpper[axis][b] has the
// cells for which bit b of the coordinate on `axis` is set.
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
    throw Error(ErrorCode::kInvalidInput, "a grid of 2^" + std::to_string(grid_levels) +
                                              " cells per edge, expected at most 2^" +
                                              std::to_string(dag.grid_levels()));
}

}  // namespace voxdag::query
