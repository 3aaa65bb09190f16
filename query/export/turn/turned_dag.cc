#include "query/export/turn/turned_dag.h"

#include <array>
#include <string>

#include "core/base/options/option_text.h"

namespace voxdag::query {
namespace {

using ChildOrder = std::array<int, 8>;  // by index of a child: its index after the turn

ChildOrder child_order(const AxisTurn& turn) {
  ChildOrder order{};
  for (int i = 0; i < 8; ++i) order[static_cast<size_t>(i)] = turn.turned_child(i);
  return order;
}

uint32_t turned_mask(uint32_t mask, const ChildOrder& order) {
  uint32_t turned = 0;
  for (size_t i = 0; i < 8; ++i) turned |= (mask >> i & 1) << order[i];
  return turned;
}

// Copies the levels of a DAG, with the children of each node and the voxels of each brick in the
// order after the turn.
class NodeTurner {
 public:
  NodeTurner(const DagView& dag, const AxisTurn& turn, const CancelToken& cancel)
      : dag_(dag), order_(child_order(turn)), cancel_(cancel) {
    for (uint32_t mask = 0; mask < 256; ++mask) masks_[mask] = turned_mask(mask, order_);
  }

  void turn_nodes(uint32_t level, uint32_t* to) const {
    const std::span<const uint32_t> words = dag_.level(level).words;
    const bool wide = dag_.level(level + 1).wide;
    uint64_t count = 0;
    for (uint64_t at = 0; at < words.size();) {
      if (++count % kNodesPerCheck == 0) cancel_.check();
      const DagView::Children children = dag_.children_of_node(level, at);
      to[at] = masks_[children.mask];
      std::array<uint64_t, 8> offsets{};
      for (int i = 0; i < 8; ++i)
        if (children.has(i)) offsets[at_turned(i)] = dag_.offset(children, i);
      uint64_t next = at + 1;
      for (size_t i = 0; i < 8; ++i) {
        if (!(to[at] >> i & 1)) continue;
        to[next++] = static_cast<uint32_t>(offsets[i]);
        if (wide) to[next++] = static_cast<uint32_t>(offsets[i] >> 32);
      }
      at = next;
    }
  }

  void turn_bricks(uint32_t level, uint32_t* to) const {
    const std::span<const uint32_t> words = dag_.level(level).words;
    for (uint64_t at = 0; at + 1 < words.size(); at += 2) {
      if (at % kNodesPerCheck == 0) cancel_.check();
      const uint64_t mask = turned_brick(words[at] | uint64_t{words[at + 1]} << 32);
      to[at] = static_cast<uint32_t>(mask);
      to[at + 1] = static_cast<uint32_t>(mask >> 32);
    }
  }

 private:
  static constexpr uint64_t kNodesPerCheck = 1 << 20;
  size_t at_turned(int child) const {
    return static_cast<size_t>(order_[static_cast<size_t>(child)]);
  }
  // A brick has 8 octants of 8 voxels. Both the octants in the brick and the voxels in an octant
  // are ordered like the children of a node, so the same permutation applies to both.
  uint64_t turned_brick(uint64_t mask) const {
    uint64_t turned = 0;
    for (int i = 0; i < 8; ++i) turned |= uint64_t{masks_[mask >> 8 * i & 255]} << 8 * at_turned(i);
    return turned;
  }

  const DagView& dag_;
  const ChildOrder order_;
  const CancelToken& cancel_;
  std::array<uint32_t, 256> masks_{};
};

std::vector<PageBuffer<uint32_t>> turned_levels(const DagView& dag, const AxisTurn& turn,
                                                MemoryBudget& budget, const CancelToken& cancel) {
  const uint32_t brick_level = dag.grid_levels() - kBrickLevels;
  const NodeTurner turner(dag, turn, cancel);
  std::vector<PageBuffer<uint32_t>> levels;
  for (uint32_t level = 0; level <= brick_level; ++level) {
    levels.emplace_back(budget, dag.level(level).words.size(),
                        "the DAG with turned axes (" + option_text("up") + ")");
    if (level < brick_level)
      turner.turn_nodes(level, levels.back().data());
    else
      turner.turn_bricks(level, levels.back().data());
  }
  return levels;
}

std::vector<DagView::Level> views_of(const std::vector<PageBuffer<uint32_t>>& levels,
                                     const DagView& dag) {
  std::vector<DagView::Level> views;
  for (uint32_t level = 0; level < levels.size(); ++level)
    views.push_back({{levels[level].data(), levels[level].size()}, dag.level(level).wide});
  return views;
}

}  // namespace

TurnedDag::TurnedDag(const DagView& dag, const AxisTurn& turn, const std::string& path,
                     MemoryBudget& budget, const CancelToken& cancel)
    : levels_(turned_levels(dag, turn, budget, cancel)),
      view_(views_of(levels_, dag), dag.grid_levels(), path) {}

}  // namespace voxdag::query
