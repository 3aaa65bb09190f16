#include "query/lookup/nearest.h"

#include <algorithm>
#include <bit>

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

  // Searches in a cube. `low` is its low corner.
  Nearest run(uint32_t depth, const Position& low, uint64_t content) {
    if (may_improve(low, distance_to(low, int64_t{1} << (grid_levels_ - depth))))
      enter(depth, low, content);
    if (!best_.found) best_.squared_distance = 0;
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
    return squared_on(0, low[0], edge) + squared_on(1, low[1], edge) + squared_on(2, low[2], edge);
  }
  // The part of one axis in distance_to().
  uint64_t squared_on(size_t axis, int64_t low, int64_t edge) const {
    const int64_t d = std::max({low - from_[axis], from_[axis] - (low + edge - 1), int64_t{0}});
    return static_cast<uint64_t>(d) * static_cast<uint64_t>(d);
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
    // For each axis, the part of the lower and of the upper children.
    uint64_t squared[3][2];
    for (size_t axis = 0; axis < 3; ++axis)
      for (int upper = 0; upper < 2; ++upper)
        squared[axis][upper] = squared_on(axis, low[axis] + upper * half, half);
    Child sorted[8];
    int count = 0;
    for (int i = 0; i < 8; ++i) {
      const int x = i >> 2, y = i >> 1 & 1, z = i & 1;
      const Child child{squared[0][x] + squared[1][y] + squared[2][z],
                        i,
                        {low[0] + x * half, low[1] + y * half, low[2] + z * half}};
      if (!children.has(i) || child.squared > best_.squared_distance) continue;
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
  if (dag.empty()) return {};
  return NearestSearch(dag, grid_levels, from, max_squared).run(0, {0, 0, 0}, dag.root());
}

Nearest NearestFinder::find(const Position& from, uint32_t reach) {
  // The nearest cell is at a distance of at most sqrt(3) * reach, and so also on each axis. The
  // cube contains all cells from `low` to `high` if their coordinates are equal in all but the last
  // `shift` bits.
  const int64_t margin = int64_t{7} * reach / 4;  // at least sqrt(3) * reach, rounded down
  uint64_t different = 0;
  for (const int64_t coordinate : from) {
    const int64_t low = std::max<int64_t>(coordinate - margin, 0);
    const int64_t high = std::min<int64_t>(coordinate + margin, (int64_t{1} << grid_levels_) - 1);
    different |= static_cast<uint64_t>(low ^ high);
  }
  const uint32_t shift = static_cast<uint32_t>(std::bit_width(different));
  const uint32_t depth = grid_levels_ - shift;
  if (!descend(from, depth)) return {};
  Position corner = from;
  for (int64_t& coordinate : corner) coordinate = coordinate >> shift << shift;
  return NearestSearch(dag_, grid_levels_, from, uint64_t{3} * reach * reach)
      .run(depth, corner, contents_[depth]);
}

// Stores the contents of the cubes that contain the cell `to`, down to `depth`. Returns false if
// one of these cubes has no cells.
bool NearestFinder::descend(const Position& to, uint32_t depth) {
  uint64_t different = 0;
  for (size_t axis = 0; axis < 3; ++axis) different |= static_cast<uint64_t>(at_[axis] ^ to[axis]);
  depth_ = std::min(depth_, grid_levels_ - static_cast<uint32_t>(std::bit_width(different)));
  at_ = to;
  for (; depth_ < depth; ++depth_) {
    const DagView::Children children = dag_.children(depth_, contents_[depth_]);
    const uint32_t shift = grid_levels_ - depth_ - 1;
    const int index = static_cast<int>((to[0] >> shift & 1) << 2 | (to[1] >> shift & 1) << 1 |
                                       (to[2] >> shift & 1));
    if (!children.has(index)) return false;
    contents_[depth_ + 1] = dag_.content(depth_, children, index);
  }
  return true;
}

}  // namespace voxdag::query
