#include "core/dag/space/cube_walk.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "core/base/integers.h"
#include "core/base/memory_budget.h"
#include "core/dag/consing/slot_order.h"
#include "core/dag/space/window_tile.h"

namespace voxdag {
namespace {

constexpr int kNeighbors = 8;

// The nodes of a cube and of its neighbors, in the order of CubeNeighbors. Each element is the
// number that NeighborNodes gives the node, or 0 if the node's cube is empty.
using Neighborhood = std::array<uint32_t, kNeighbors>;

// The result of NeighborFilter::filter() for a neighborhood.
struct FilteredNode {
  Neighborhood key{};
  uint64_t hash = 0;
  OctreeCounts counts;
  uint32_t id = 0;
  bool exists = false;
  bool is_used = false;
};

// Hash table of the results for all neighborhoods of one depth, so that each result is computed
// once. If there is not enough memory for a larger table, add() empties the table. Removed results
// are computed again when they are needed.
class FilteredNodes {
 public:
  const FilteredNode* find(const Neighborhood& key) const {
    if (used_slots_ == 0) return nullptr;
    const FilteredNode& found = slots_[slot_of(key)];
    return found.is_used ? &found : nullptr;
  }
  void add(PooledMemory& memory, const FilteredNode& node) {
    if (count_ + 1 > entries_for(used_slots_)) make_room(memory);
    slots_[slot_of(node.key)] = node;
    ++count_;
  }

 private:
  uint64_t slot_of(const Neighborhood& key) const {
    uint64_t hash = 0x9e3779b97f4a7c15ull;
    for (size_t i = 0; i < key.size(); i += 2)
      hash = fold_multiply(hash ^ (uint64_t{key[i]} << 32 | key[i + 1]), 0xd6e8feb86659fd93ull);
    for (uint64_t at = hash;; ++at) {
      const uint64_t slot = at & (used_slots_ - 1);
      if (!slots_[slot].is_used || slots_[slot].key == key) return slot;
    }
  }
  void make_room(PooledMemory& memory) {
    const uint64_t slots = slots_for(2 * count_ + 1);
    const uint64_t bytes = slots * sizeof(FilteredNode);
    if (used_slots_ != 0 && memory.budget.available() / kBudgetPart < bytes) {
      std::fill_n(slots_.begin(), used_slots_, FilteredNode{});
      count_ = 0;
      return;
    }
    PooledArray<FilteredNode> old = std::move(slots_);
    const uint64_t old_slots = std::exchange(used_slots_, slots);
    slots_ = PooledArray<FilteredNode>(memory, slots, PooledArray<FilteredNode>::kZero);
    for (uint64_t i = 0; i < old_slots; ++i)
      if (old[i].is_used) slots_[slot_of(old[i].key)] = old[i];
  }

  // A table grows only if the new table takes at most 1/kBudgetPart of the available memory.
  static constexpr uint64_t kBudgetPart = 4;

  PooledArray<FilteredNode> slots_;
  uint64_t used_slots_ = 0, count_ = 0;
};

// Numbers the nodes of a cube and its neighbors, which can be in one sub-DAG or in several. All
// nodes at the same depth below the cubes have distinct numbers, from 1.
class NeighborNodes {
 public:
  NeighborNodes(const CubeNeighbors& cubes, int depths) {
    std::vector<uint64_t> next(static_cast<size_t>(depths), 1);
    for (const NodePlace& place : cubes) {
      if (place.levels == nullptr || find(place) != nullptr) continue;
      Source source{place.levels, place.depth, {}};
      for (size_t d = 0; d < next.size(); ++d) {
        source.first.push_back(static_cast<uint32_t>(next[d]));
        next[d] += place.levels->rows(place.depth + static_cast<int>(d));
        if (next[d] >= UINT32_MAX) throw OutOfBudget();
      }
      sources_.push_back(std::move(source));
    }
  }

  uint32_t number(const NodePlace& place) const {
    return place.levels == nullptr ? 0 : find(place)->first[0] + place.row;
  }
  // Writes the numbers of a node's children to `out`, by octant. The number of an absent child is
  // 0.
  void children(int depth, uint32_t node, uint32_t (&out)[8]) const {
    std::fill(std::begin(out), std::end(out), 0);
    if (node == 0) return;
    const Source& source = source_of(depth, node);
    const NodeLevels::Level& level = source.levels->nodes[static_cast<size_t>(source.top + depth)];
    const uint32_t row = node - source.first[static_cast<size_t>(depth)];
    const uint32_t first = source.first[static_cast<size_t>(depth) + 1];
    const uint32_t* child = level.children.data() + level.first_child[row];
    for (uint32_t rest = level.masks[row]; rest != 0; rest &= rest - 1)
      out[std::countr_zero(rest)] = first + *child++;
  }
  uint64_t brick(int depth, uint32_t node) const {
    const Source& source = source_of(depth, node);
    return source.levels->bricks[node - source.first[static_cast<size_t>(depth)]];
  }

 private:
  struct Source {
    const NodeLevels* levels;
    int top;                      // depth of the cubes' nodes in `levels`
    std::vector<uint32_t> first;  // by depth below the cubes: number of the node in row 0
  };
  const Source* find(const NodePlace& place) const {
    for (const Source& source : sources_)
      if (source.levels == place.levels) return &source;
    return nullptr;
  }
  const Source& source_of(int depth, uint32_t node) const {
    size_t i = sources_.size() - 1;
    while (node < sources_[i].first[static_cast<size_t>(depth)]) --i;
    return sources_[i];
  }

  std::vector<Source> sources_;
};

// The set that a NeighborFilter computes: blocked positions or enclosed voxels (cube_walk.h).
enum class WalkFilter { kBlocked, kEnclosed };

class NeighborFilter {
 public:
  NeighborFilter(PooledMemory& memory, WalkFilter filter, const CubeNeighbors& cubes, int size_log2,
                 uint32_t radius, SubDagTables& tables)
      : memory_(memory),
        filter_(filter),
        radius_(static_cast<int>(radius)),
        size_log2_(size_log2),
        base_log2_(smallest_filtered(radius)),
        nodes_(cubes, size_log2 - kBrickLevels + 1),
        tables_(tables),
        filtered_(static_cast<size_t>(size_log2 - base_log2_) + 1) {
    for (size_t i = 0; i < cubes.size(); ++i) root_[i] = nodes_.number(cubes[i]);
  }

  NodeRef run() { return filter(0, root_); }

 private:
  NodeRef filter(int depth, const Neighborhood& cubes) {
    if (is_empty(cubes)) return {};
    FilteredNodes& known = filtered_[static_cast<size_t>(depth)];
    if (const FilteredNode* const node = known.find(cubes)) {
      tables_.counts() += node->counts;
      return {node->hash, node->id, node->exists};
    }
    const OctreeCounts before = tables_.counts();
    const NodeRef out =
        size_log2(depth) == base_log2_ ? filter_tile(depth, cubes) : filter_octants(depth, cubes);
    known.add(memory_, {cubes, out.hash, tables_.counts() - before, out.id, out.exists, true});
    return out;
  }
  int size_log2(int depth) const { return size_log2_ - depth; }

  // True if the result is certainly empty, because the cubes that determine it have no voxels.
  bool is_empty(const Neighborhood& cubes) const {
    if (filter_ == WalkFilter::kEnclosed) return cubes[0] == 0;
    return std::ranges::all_of(cubes, [](uint32_t node) { return node == 0; });
  }

  NodeRef filter_octants(int depth, const Neighborhood& cubes) {
    uint32_t children[kNeighbors][8];
    for (size_t n = 0; n < kNeighbors; ++n) nodes_.children(depth, cubes[n], children[n]);
    NodeRef octants[8];
    for (uint32_t o = 0; o < 8; ++o) {
      // The neighbor n of octant o is the octant o ^ n of the same cube or of a neighboring cube.
      // Along the axes in `leaves & n`, the step to the neighbor leaves the cube. So the neighbor
      // is in the cube's neighbor `leaves & n` (0: in the same cube).
      const uint32_t leaves = filter_ == WalkFilter::kBlocked ? o : ~o;
      Neighborhood around;
      for (uint32_t n = 0; n < kNeighbors; ++n) around[n] = children[leaves & n][o ^ n];
      octants[o] = filter(depth + 1, around);
    }
    return tables_.add_node(size_log2(depth), octants);
  }

  // Computes the result for cubes of the smallest size with a tile of 2 x 2 x 2 cubes. spread()
  // sets p if any voxel in p + [0, V]^3 is set, where V is the radius. Blocked positions are
  // exactly these p. For enclosed voxels, the set voxels of the tile are the open positions. A
  // voxel x is enclosed if no position in x - [0, V]^3 is open. These positions are p + [0, V]^3
  // with p = x - V. So the result for voxel x is at x - V in the tile. The cube of results begins
  // at the tile's coordinate `low`, along each axis.
  NodeRef filter_tile(int depth, const Neighborhood& cubes) {
    const int edge = 1 << base_log2_;
    const bool is_blocked = filter_ == WalkFilter::kBlocked;
    tile_.reset(2 * edge);
    for (int n = 0; n < kNeighbors; ++n) {
      const int at = is_blocked ? n : 7 - n;
      put(depth, cubes[static_cast<size_t>(n)], (at >> 2) * edge, (at >> 1 & 1) * edge,
          (at & 1) * edge);
    }
    if (!is_blocked) tile_.invert();
    tile_.spread(radius_);
    if (!is_blocked) tile_.invert();
    const int low = is_blocked ? 0 : edge - radius_;
    return take(base_log2_, low, low, low);
  }

  // Sets the voxels of a node in tile_. The node's low corner is at (x, y, z).
  void put(int depth, uint32_t node, int x, int y, int z) {
    if (node == 0) return;
    if (size_log2(depth) == kBrickLevels)
      return tile_.put_brick(nodes_.brick(depth, node), x, y, z);
    uint32_t children[8];
    nodes_.children(depth, node, children);
    const int half = 1 << (size_log2(depth) - 1);
    for (int o = 0; o < 8; ++o)
      put(depth + 1, children[o], x + (o >> 2) * half, y + (o >> 1 & 1) * half, z + (o & 1) * half);
  }
  // Adds the voxels of a cube in tile_ to tables_, and returns their node. The cube has 2^size
  // voxels per edge, and its low corner is at (x, y, z).
  NodeRef take(int size, int x, int y, int z) {
    if (size == kBrickLevels) return tables_.add_brick(tile_.brick(x, y, z));
    const int half = 1 << (size - 1);
    NodeRef octants[8];
    for (int o = 0; o < 8; ++o)
      octants[o] = take(size - 1, x + (o >> 2) * half, y + (o >> 1 & 1) * half, z + (o & 1) * half);
    return tables_.add_node(size, octants);
  }

  PooledMemory& memory_;
  const WalkFilter filter_;
  const int radius_, size_log2_, base_log2_;
  const NeighborNodes nodes_;
  SubDagTables& tables_;
  std::vector<FilteredNodes> filtered_;  // by depth
  Neighborhood root_{};
  WindowTile tile_;
};

}  // namespace

int smallest_filtered(uint32_t radius) {
  return std::max(kBrickLevels, static_cast<int>(std::bit_width(radius - 1)));
}

uint8_t octants_near(int n, bool is_higher) {
  uint8_t octants = 0;
  for (int o = 0; o < 8; ++o)
    if (((is_higher ? o : ~o) & n) == 0) octants = static_cast<uint8_t>(octants | 1 << o);
  return octants;
}

NodeRef add_blocked(PooledMemory& memory, const CubeNeighbors& shell, int size_log2,
                    uint32_t radius, SubDagTables& tables) {
  return NeighborFilter(memory, WalkFilter::kBlocked, shell, size_log2, radius, tables).run();
}

NodeRef add_enclosed(PooledMemory& memory, const CubeNeighbors& closed, int size_log2,
                     uint32_t radius, SubDagTables& tables) {
  return NeighborFilter(memory, WalkFilter::kEnclosed, closed, size_log2, radius, tables).run();
}

}  // namespace voxdag
