#include "query/stats/level_stats.h"

#include <bitset>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/base/popcount8.h"
#include "core/format/global/node_index.h"

namespace voxdag::query {
namespace {

using OctantMasks = std::bitset<256>;

NodeIndex index_of(const voxdag_reader::File& file, uint32_t level, MemoryBudget& budget,
                   const CancelToken& cancel) {
  const bool bricks = level == file.brick_level();
  const bool wide = !bricks && file.level(level + 1).pointer_bits == 64;
  const Pointers pointers = bricks ? Pointers::kNone : wide ? Pointers::kWide : Pointers::kNarrow;
  return NodeIndex(file.level(level), pointers, 1, budget, cancel,
                   file.path() + ": level " + std::to_string(level));
}

// Adds a brick to the statistics. Octant i of a brick is bits 8i to 8i + 7 of its mask.
void add_brick(uint64_t mask, LevelStats& stats, OctantMasks& masks) {
  size_t octants = 0;
  for (int i = 0; i < 8; ++i) {
    const uint64_t octant = mask >> 8 * i & 255;
    octants += octant != 0;
    masks.set(octant);
  }
  if (octants > 0) ++stats.nodes_by_children[octants - 1];
}

}  // namespace

DagStats dag_stats(const voxdag_reader::File& file, MemoryBudget& budget,
                   const CancelToken& cancel) {
  DagStats stats;
  if (file.empty()) return stats;
  stats.levels.resize(file.brick_level() + 1);
  OctantMasks masks;
  // Occurrences in the octree of each node of the current level.
  PageBuffer<uint64_t> times(budget, file.level(0).node_count, "counts of a level");
  NodeIndex index = index_of(file, 0, budget, cancel);
  times[0] = 1;
  for (uint32_t l = 0; l <= file.brick_level(); ++l) {
    const bool bricks = l == file.brick_level();
    LevelStats& level = stats.levels[l];
    NodeIndex next;
    if (!bricks) next = index_of(file, l + 1, budget, cancel);
    PageBuffer<uint64_t> child_times(budget, bricks ? 0 : file.level(l + 1).node_count,
                                     "counts of a level");
    for (uint64_t span = 0; span < index.span_count(); ++span) {
      cancel.check();
      index.visit_span(span, [&](uint64_t i, uint64_t offset) {
        level.svo_nodes += times[i];
        if (bricks) return add_brick(file.brick(offset), level, masks);
        const voxdag_reader::Node node = file.node(l, offset);
        const int children = kPopcount8[node.child_mask];
        ++level.nodes_by_children[static_cast<size_t>(children - 1)];
        for (int c = 0; c < children; ++c) {
          const uint64_t child = next.find(node.child(c));
          if (child == NodeIndex::kNone)
            throw Error(ErrorCode::kCorrupt, file.path() + ": level " + std::to_string(l) +
                                                 ", word " + std::to_string(offset) +
                                                 ": a child pointer leads to a word at which no "
                                                 "node begins: expected a node");
          child_times[child] += times[i];
        }
      });
    }
    times = std::move(child_times);
    index = std::move(next);
  }
  masks.reset(0);
  stats.octant_masks = masks.count();
  return stats;
}

}  // namespace voxdag::query
