#include "core/dag/space/enclosed_fill.h"

#include <algorithm>
#include <vector>

#include "core/base/integers.h"
#include "core/dag/consing/slot_order.h"

namespace voxdag {
namespace {

// A node, the set of its components (space_labels.h) that are outside, and the node with which the
// fill replaces it.
struct FilledNode {
  uint64_t outside = 0;  // bit c: component c is outside
  uint64_t hash = 0;
  OctreeCounts counts;
  uint32_t row_plus_1 = 0;  // 0: free slot
  uint32_t id = 0;
};

// The filled nodes of one depth, in a table with open addressing.
class FilledNodes {
 public:
  // Returns the slot of the node `row` with the outside components `outside`, or a free slot if the
  // table does not contain it.
  FilledNode& find(PooledMemory& memory, uint32_t row, uint64_t outside) {
    if (count_ + 1 > entries_for(used_slots_)) grow(memory);
    return slot(row, outside);
  }
  void add(FilledNode& free_slot, const FilledNode& filled) {
    free_slot = filled;
    ++count_;
  }

 private:
  FilledNode& slot(uint32_t row, uint64_t outside) {
    uint64_t at = fold_multiply(outside ^ 0x9e3779b97f4a7c15ull, row + 0xd6e8feb86659fd93ull);
    while (true) {
      FilledNode& found = slots_[at & (used_slots_ - 1)];
      if (found.row_plus_1 == 0 || (found.row_plus_1 == row + 1 && found.outside == outside))
        return found;
      ++at;
    }
  }
  void grow(PooledMemory& memory) {
    PooledArray<FilledNode> old = std::move(slots_);
    const uint64_t old_slots = std::exchange(used_slots_, slots_for(2 * count_ + 1));
    slots_ = PooledArray<FilledNode>(memory, used_slots_, PooledArray<FilledNode>::kZero);
    for (uint64_t i = 0; i < old_slots; ++i)
      if (old[i].row_plus_1 != 0) slot(old[i].row_plus_1 - 1, old[i].outside) = old[i];
  }

  PooledArray<FilledNode> slots_;
  uint64_t used_slots_ = 0, count_ = 0;
};

class Filler {
 public:
  // If `keeps_closed` is true, closed components (space_labels.h) remain empty.
  Filler(PooledMemory& memory, const SpaceLabels& labels, bool keeps_closed, SubDagTables& tables,
         const CancelToken* cancel = nullptr)
      : cancel_(cancel),
        memory_(memory),
        labels_(labels),
        keeps_closed_(keeps_closed),
        tables_(tables),
        filled_(static_cast<size_t>(labels.levels().brick_depth())),
        full_(static_cast<size_t>(tables.size_log2()) + 1) {}

  void run(std::span<const uint8_t> is_outside) {
    numbers_.assign(is_outside.begin(), is_outside.end());
    fill(0, {true, 0, 0});
  }

  // Like run(is_outside), but also fills the component that contains the voxel `seed`, if this
  // component is closed. `labels` must be the labels that were passed to the constructor.
  void run(std::span<const uint8_t> is_outside, SpaceLabels& labels, const CubeVoxel& seed) {
    const SeedPlace place = find_seed(labels, seed);
    if (place.kind != SeedPlace::Kind::kClosed) return run(is_outside);
    numbers_.assign(is_outside.begin(), is_outside.end());
    fill_around(0, {true, 0, 0}, labels, seed, place);
  }

 private:
  // Fills a cube that contains the seed's closed component. Equal nodes at other places of the
  // octree do not contain the seed, so they are filled differently and the result is not added to
  // filled_.
  NodeRef fill_around(int depth, const LabeledCube& cube, SpaceLabels& labels,
                      const CubeVoxel& seed, const SeedPlace& place) {
    if (depth == labels_.levels().brick_depth()) {
      const uint64_t empty = ~labels_.levels().bricks[cube.row];
      const uint64_t bit = uint64_t{1} << bit_in_brick(seed);
      return tables_.add_brick(filled_mask(cube) | brick_flood(bit, empty));
    }
    const int around = octant_around(seed, labels_.levels().brick_depth(), depth);
    std::vector<uint8_t> is_filled;
    if (depth == place.depth)
      is_filled = connected_components(memory_, labels, depth, cube.row, around, place.component);
    NodeRef octants[8];
    const size_t used = numbers_.size();
    size_t component = 0;
    for (int o = 0; o < 8; ++o) {
      const LabeledCube octant = octant_of(labels_, depth, cube, o, kOutside, numbers_);
      for (size_t i = octant.first; i < numbers_.size() && !is_filled.empty(); ++i)
        if (is_filled[component++] != 0) numbers_[i] = 0;
      octants[o] = o == around && depth < place.depth
                       ? fill_around(depth + 1, octant, labels, seed, place)
                       : fill(depth + 1, octant);
      numbers_.resize(used);
    }
    return tables_.add_node(size_log2(depth), octants);
  }
  int size_log2(int depth) const { return tables_.size_log2() - depth; }

  NodeRef fill(int depth, const LabeledCube& cube) {
    if (!cube.exists) return numbers_[cube.first] != 0 ? NodeRef{} : full(size_log2(depth));
    if (depth == labels_.levels().brick_depth()) return fill_brick(cube);
    uint64_t outside = 0;
    if (!pack_outside(depth, cube, outside)) return fill_octants(depth, cube);
    if (outside == 0 && !keeps_closed_) return full(size_log2(depth));  // all its voxels are set
    FilledNodes& nodes = filled_[static_cast<size_t>(depth)];
    const FilledNode& known = nodes.find(memory_, cube.row, outside);
    if (known.row_plus_1 != 0) {
      tables_.counts() += known.counts;
      return {known.hash, known.id, true};
    }
    const OctreeCounts before = tables_.counts();
    const NodeRef node = fill_octants(depth, cube);
    nodes.add(nodes.find(memory_, cube.row, outside),
              {outside, node.hash, tables_.counts() - before, cube.row + 1, node.id});
    return node;
  }

  // Sets bit c of `outside` if component c of the cube is outside. If all components are outside,
  // sets all bits. Returns false if some components are outside and some are not, and 64 bits are
  // too few for them.
  bool pack_outside(int depth, const LabeledCube& cube, uint64_t& outside) const {
    const uint32_t count = labels_.count(depth, cube.row);
    uint32_t ones = 0;
    for (uint32_t c = 0; c < count; ++c) {
      const uint64_t bit = numbers_[cube.first + c];
      ones += static_cast<uint32_t>(bit);
      outside |= bit << (c & 63);
    }
    if (ones == count && ones != 0) outside = ~uint64_t{0};
    return count < 64 || ones == count || ones == 0;
  }

  NodeRef fill_octants(int depth, const LabeledCube& cube) {
    if (cancel_ && filled_nodes_++ % kNodesPerCheck == 0) cancel_->check();
    NodeRef octants[8];
    const size_t used = numbers_.size();
    for (int o = 0; o < 8; ++o) {
      octants[o] = fill(depth + 1,
                        octant_of(labels_, depth, cube, o, keeps_closed_ ? kOutside : 0, numbers_));
      numbers_.resize(used);
    }
    return tables_.add_node(size_log2(depth), octants);
  }

  NodeRef fill_brick(const LabeledCube& cube) { return tables_.add_brick(filled_mask(cube)); }

  uint64_t filled_mask(const LabeledCube& cube) const {
    const uint32_t count = labels_.count(labels_.levels().brick_depth(), cube.row);
    const uint64_t* const components = labels_.brick_components(cube.row);
    uint64_t outside = 0, inside = labels_.levels().bricks[cube.row];
    for (uint32_t c = 0; c < count; ++c)
      (numbers_[cube.first + c] != 0 ? outside : inside) |= components[c];
    return keeps_closed_ ? inside : ~outside;
  }

  // Returns the node of a cube of which all voxels are set.
  NodeRef full(int size) {
    NodeRef& known = full_[static_cast<size_t>(size)];
    if (!known.exists) {
      const OctreeCounts before = tables_.counts();
      known = make_full(size);
      tables_.counts() = before;
    }
    tables_.counts() += full_counts(size);
    return known;
  }
  NodeRef make_full(int size) {
    if (size == kBrickLevels) return tables_.add_brick(~uint64_t{0});
    NodeRef octants[8];
    std::fill(std::begin(octants), std::end(octants), full(size - 1));
    return tables_.add_node(size, octants);
  }

  static constexpr uint32_t kOutside = 1;

  static constexpr uint64_t kNodesPerCheck = 1024;

  const CancelToken* const cancel_;
  uint64_t filled_nodes_ = 0;
  PooledMemory& memory_;
  const SpaceLabels& labels_;
  const bool keeps_closed_;
  SubDagTables& tables_;
  std::vector<FilledNodes> filled_;  // by depth
  std::vector<NodeRef> full_;        // by log2 of the edge
  // For each component of each cube on the current path: 1 if it is outside, otherwise 0.
  std::vector<uint32_t> numbers_;
};

}  // namespace

void fill_enclosed(PooledMemory& memory, const SpaceLabels& labels,
                   std::span<const uint8_t> is_outside, SubDagTables& tables,
                   const CancelToken* cancel) {
  Filler(memory, labels, false, tables, cancel).run(is_outside);
}

void fill_from_seed(PooledMemory& memory, SpaceLabels& labels, std::span<const uint8_t> is_outside,
                    const std::optional<CubeVoxel>& seed, SubDagTables& tables) {
  Filler filler(memory, labels, true, tables);
  if (seed)
    filler.run(is_outside, labels, *seed);
  else
    filler.run(is_outside);
}

}  // namespace voxdag
