#include "query/lookup/nearest.h"

#include <algorithm>

#include "core/geometry/morton.h"

namespace voxdag::query {
namespace {

class NearestSearch {
 public:
  NearestSearch(const DagView& dag, uint32_t grid_levels, const Position& from,
                uint64_t max_squared)
      : dag_(dag), grid_levels_(grid_levels), from_(from) {
    best_.squared_distance = max_squared;
  }

  Nearest run() {
    const Position origin = {0, 0, 0};
    if (!dag_.empty() && may_improve(origin, distance_to(origin, int64_t{1} << grid_levels_)))
      enter(0, origin, dag_.root());
    return best_;
  }

 private:
  struct Child {
    uint64_t squared;
    int index;
    Position low;
  };

  // Returns the squared distance from the cell `from_` to the nearest cell of a cube. It is exact,
  // because the coordinates are integers.
  uint64_t distance_to(const Position& low, int64_t edge) const {
    uint64_t squared = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const int64_t d =
          std::max({low[axis] - from_[axis], from_[axis] - (low[axis] + edge - 1), int64_t{0}});
      squared += static_cast<uint64_t>(d) * static_cast<uint64_t>(d);
    }
    return squared;
  }
  static uint64_t morton_of(const Position& p) {
    return morton_encode(static_cast<uint32_t>(p[0]), static_cast<uint32_t>(p[1]),
                         static_cast<uint32_t>(p[2]));
  }
  // True if a cube at the squared distance `squared` can have a better cell than the best cell so
  // far. `low` is the cube's low corner, the cell with the cube's lowest Morton code.
  bool may_improve(const Position& low, uint64_t squared) const {
    if (squared != best_.squared_distance) return squared < best_.squared_distance;
    return !best_.found || morton_of(low) < morton_of(best_.cell);
  }

  void enter(uint32_t depth, const Position& low, uint64_t content) {
    if (depth == grid_levels_) {
      best_ = {low, distance_to(low, 1), true};
      return;
    }
    const DagView::Children children = dag_.children(depth, content);
    const int64_t half = int64_t{1} << (grid_levels_ - depth - 1);
    Child sorted[8];
    int count = 0;
    for (int i = 0; i < 8; ++i) {
      if (!children.has(i)) continue;
      Child child{
          0,
          i,
          {low[0] + (i & 4 ? half : 0), low[1] + (i & 2 ? half : 0), low[2] + (i & 1 ? half : 0)}};
      child.squared = distance_to(child.low, half);
      int at = count++;
      for (; at > 0 && sorted[at - 1].squared > child.squared; --at) sorted[at] = sorted[at - 1];
      sorted[at] = child;
    }
    for (int i = 0; i < count; ++i) {
      if (sorted[i].squared > best_.squared_distance) return;
      if (may_improve(sorted[i].low, sorted[i].squared))
        enter(depth + 1, sorted[i].low, dag_.content(depth, children, sorted[i].index));
    }
  }

  const DagView& dag_;
  const uint32_t grid_levels_;
  const Position from_;
  Nearest best_;
};

}  // namespace

Nearest find_nearest(const DagView& dag, uint32_t grid_levels, const Position& from,
                     uint64_t max_squared) {
  Nearest nearest = NearestSearch(dag, grid_levels, from, max_squared).run();
  if (!nearest.found) nearest.squared_distance = 0;
  return nearest;
}

}  // namespace voxdag::query
