#include "query/lookup/points.h"

#include <algorithm>

#include "core/base/popcount8.h"

namespace voxdag::query {
namespace {

// Number of concurrent descents. It is enough to hide the latency of memory; a larger number is not
// faster (measured).
constexpr size_t kGroup = 32;

// Runs descents. A descent is one lookup's way from the root, or from a node of TopCells, to its
// cell. Up to kGroup descents run interleaved.
class Descents {
 public:
  Descents(const DagView& dag, const TopCells* top, uint32_t grid_levels)
      : dag_(dag),
        top_(top && TopCells::serve(dag, grid_levels) ? top : nullptr),
        grid_levels_(grid_levels) {}

  void run(std::span<const Position> points, uint8_t* set) {
    const uint64_t edge = uint64_t{1} << grid_levels_;
    for (size_t i = 0; i < points.size(); ++i) {
      const auto [x, y, z] = points[i];
      set[i] = 0;
      // As unsigned numbers, negative coordinates are large.
      if ((static_cast<uint64_t>(x) | static_cast<uint64_t>(y) | static_cast<uint64_t>(z)) >= edge)
        continue;
      Descent d = {dag_.root(), static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                   static_cast<uint32_t>(z), static_cast<uint32_t>(i)};
      if (top_ && !begin_at_top(d)) continue;
      descents_[count_++] = d;
      if (count_ == kGroup) finish(set);
    }
    finish(set);
  }

 private:
  struct Descent {
    uint64_t content;
    uint32_t x, y, z, point;
    int child_index(uint32_t shift) const {
      return static_cast<int>((x >> shift & 1) << 2 | (y >> shift & 1) << 1 | (z >> shift & 1));
    }
  };

  // Moves a new descent to the node of TopCells that contains its point. Returns false if the
  // descent ends there, because the node or its child at the point does not exist.
  bool begin_at_top(Descent& d) const {
    const uint32_t shift = grid_levels_ - TopCells::kLevels;
    const TopCells::Cell cell = top_->at(d.x >> shift, d.y >> shift, d.z >> shift);
    if (!(cell.mask() >> d.child_index(shift - 1) & 1)) return false;
    d.content = cell.offset();
    dag_.prefetch(TopCells::kLevels, d.content);
    return true;
  }

  // Runs all descents to their ends.
  void finish(uint8_t* set) {
    const uint32_t brick_depth = dag_.grid_levels() - 2;
    for (uint32_t depth = top_ ? TopCells::kLevels : 0; depth < std::min(grid_levels_, brick_depth);
         ++depth)
      descend(depth);
    for (size_t i = 0; i < count_; ++i) set[descents_[i].point] = ends_set(descents_[i]);
    count_ = 0;
  }

  // Moves each descent from its node at `depth` to the child that contains the point. Ends the
  // descents whose node has no such child.
  void descend(uint32_t depth) {
    const std::span<const uint32_t> words = dag_.level(depth).words;
    const DagView::Level& below = dag_.level(depth + 1);
    const uint32_t shift = grid_levels_ - 1 - depth;
    const bool last = depth + 1 == grid_levels_;
    size_t left = 0;
    for (size_t i = 0; i < count_; ++i) {
      Descent d = descents_[i];
      if (d.content >= words.size()) dag_.corrupt(depth, d.content);
      const uint32_t mask = words[d.content];
      const uint32_t bit = 1u << d.child_index(shift);
      // This code has no branch, because the CPU cannot predict which descents end here.
      const uint64_t place = uint64_t{kPopcount8[mask & (bit - 1)]} << below.wide;
      const bool has_child = mask & bit;
      if (has_child && place + below.wide + 1 >= words.size() - d.content)
        dag_.corrupt(depth, d.content);
      const uint64_t at = has_child ? d.content + 1 + place : 0;
      d.content = words[at];
      if (below.wide && has_child) d.content |= uint64_t{words[at + 1]} << 32;
      descents_[left] = d;
      left += has_child;
      if (!last && has_child && d.content < below.words.size())
        __builtin_prefetch(below.words.data() + d.content);
    }
    count_ = left;
  }

  // True if the cell at the end of a descent is set.
  bool ends_set(const Descent& d) const {
    if (grid_levels_ + 2 <= dag_.grid_levels()) return true;
    // Number of levels from the brick to the cells: 1 for octants, 2 for voxels.
    const uint32_t voxel_levels = grid_levels_ + 2 - dag_.grid_levels();
    const uint64_t mask = dag_.grid_levels() == 2 ? d.content : dag_.brick(d.content);
    const uint64_t octant = mask >> (8 * d.child_index(voxel_levels - 1)) & 255;
    return voxel_levels == 1 ? octant != 0 : octant >> d.child_index(0) & 1;
  }

  const DagView& dag_;
  const TopCells* const top_;  // null if descents begin at the root
  const uint32_t grid_levels_;
  size_t count_ = 0;
  Descent descents_[kGroup];
};

}  // namespace

void look_up(const DagView& dag, const TopCells* top, uint32_t grid_levels,
             std::span<const Position> points, std::span<uint8_t> set) {
  if (dag.empty()) {
    std::fill(set.begin(), set.end(), uint8_t{0});
    return;
  }
  Descents(dag, top, grid_levels).run(points, set.data());
}

}  // namespace voxdag::query
