#include "query/lookup/node_counts.h"

#include <algorithm>
#include <bit>
#include <string>

#include "core/base/error.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {

NodeCounts::NodeCounts(const voxdag_reader::File& file, const DagView& dag, uint32_t grid_levels,
                       MemoryBudget& budget, const CancelToken& cancel)
    : dag_(dag), grid_levels_(grid_levels) {
  if (dag.empty()) return;
  try {
    store(file, budget, cancel);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
    levels_.clear();
  }
}

// Stores the counts of the nodes on all levels that are above the bricks and at least two levels
// above the grid's cells. Bricks, and nodes whose children are the grid's cells, need no stored
// counts: their counts are the numbers of bits in their masks.
void NodeCounts::store(const voxdag_reader::File& file, MemoryBudget& budget,
                       const CancelToken& cancel) {
  if (grid_levels_ < 2 || dag_.grid_levels() < 3) return;
  const uint32_t lowest = std::min(grid_levels_ - 2, dag_.grid_levels() - 3);
  levels_.resize(lowest + 1);
  for (uint32_t depth = lowest + 1; depth-- > 0;) {
    const voxdag_reader::Level& level = file.level(depth);
    const bool wide = file.level(depth + 1).pointer_bits == 64;
    NodeIndex index(level, wide ? Pointers::kWide : Pointers::kNarrow, 1, budget, cancel,
                    "level " + std::to_string(depth));
    PageBuffer<uint64_t> counts(budget, level.node_count, "the counts of nodes");
    for (uint64_t span = 0; span < index.span_count(); ++span) {
      cancel.check();
      index.visit_span(
          span, [&](uint64_t i, uint64_t offset) { counts[i] = sum_children(depth, offset); });
    }
    levels_[depth] = {std::move(index), std::move(counts)};
  }
}

uint64_t NodeCounts::count_below(uint32_t depth, uint64_t content) const {
  if (depth == grid_levels_) return 1;
  if (depth + 2 == dag_.grid_levels() && grid_levels_ == dag_.grid_levels())
    return static_cast<uint64_t>(std::popcount(content));
  if (depth + 1 == grid_levels_)
    return static_cast<uint64_t>(popcount8(dag_.children(depth, content).mask));
  if (depth >= levels_.size()) return sum_children(depth, content);
  const uint64_t node = levels_[depth].index.find(content);
  if (node == NodeIndex::kNone) dag_.corrupt(depth, content);
  return levels_[depth].counts[node];
}

uint64_t NodeCounts::sum_children(uint32_t depth, uint64_t content) const {
  const DagView::Children children = dag_.children(depth, content);
  uint64_t sum = 0;
  for (uint32_t left = children.mask; left != 0; left &= left - 1)
    sum += count_below(depth + 1, dag_.content(depth, children, std::countr_zero(left)));
  return sum;
}

uint64_t NodeCounts::count(const Region& region) const {
  if (dag_.empty() || region.empty()) return 0;
  return count_within(region, 0, {0, 0, 0}, dag_.root());
}

uint64_t NodeCounts::count_within(const Region& region, uint32_t depth, const Position& low,
                                  uint64_t content) const {
  const int64_t edge = int64_t{1} << (grid_levels_ - depth);
  if (!region.intersects(low, edge)) return 0;
  if (region.contains(low, edge)) return count_below(depth, content);
  if (depth + 2 == dag_.grid_levels() && grid_levels_ == dag_.grid_levels())
    return static_cast<uint64_t>(std::popcount(content & mask_within(region, low)));
  const DagView::Children children = dag_.children(depth, content);
  const int64_t half = edge / 2;
  uint64_t sum = 0;
  for (uint32_t left = children.mask; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    const Position corner = {low[0] + (i & 4 ? half : 0), low[1] + (i & 2 ? half : 0),
                             low[2] + (i & 1 ? half : 0)};
    sum += count_within(region, depth + 1, corner, dag_.content(depth, children, i));
  }
  return sum;
}

}  // namespace voxdag::query
