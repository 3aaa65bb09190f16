// The first DAG construction of Sintorn, "DAG Construction" (2018), after Kämpe, Sintorn and
// Assarsson, "High Resolution Sparse Voxel DAGs" (2013). From the bottom up, the nodes of a level
// are sorted by their (up to eight) child pointers, equal neighbors become one node, and the
// parents' pointers to these nodes are updated by the mapping
//
//     original index -> sorted index -> compact index
//
// This is exact without hashes. A child pointer is a position in the total order of the level
// below. So nodes that are sorted by child pointers, then stably by mask, and then stably by hash
// are in the total order.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <utility>

#include "core/backend/parallel/dag/dag.h"
#include "core/backend/parallel/space/order.h"

namespace voxdag::parallel {

// One reduced level: the surviving octree nodes (one of each group of equal nodes), and for each
// octree node the survivor that replaces it.
template <class Space>
struct Reduced {
  uint32_t count = 0;
  SpaceArray<Space, uint32_t> survivors;  // octree nodes, in the total order
  SpaceArray<Space, uint64_t> hashes;     // hashes of the survivors
  SpaceArray<Space, uint32_t> index_of;   // by octree node: position of the node's survivor
};

// The nodes of a level, as lists of their children in the level below, which is already reduced.
struct LinkedNodes {
  OctreeNodes nodes;
  const uint32_t* index_of;  // by octree node of the level below: position of the node's survivor

  VOXDAG_HD uint32_t child(uint32_t node, uint32_t rank) const {
    return index_of[nodes.first_child[node] + rank];
  }
  // Returns 0 if the node has no child in `slot`, otherwise the child's position + 1.
  VOXDAG_HD uint64_t pointer(uint32_t node, uint32_t slot) const {
    const uint32_t mask = nodes.masks[node];
    if (!(mask >> slot & 1)) return 0;
    return uint64_t{child(node, static_cast<uint32_t>(popcount64(mask & ((1u << slot) - 1))))} + 1;
  }
};

// Combines the child pointers of slots [first, end), with `bits` bits each, into one sort key. The
// first pointer is the most significant.
struct PointerKey {
  LinkedNodes links;
  uint32_t first, end;
  int bits;
  VOXDAG_HD uint64_t operator()(uint32_t node) const {
    uint64_t key = 0;
    for (uint32_t slot = first; slot < end; ++slot) key = key << bits | links.pointer(node, slot);
    return key;
  }
};

struct MaskKey {
  const uint8_t* masks;
  VOXDAG_HD uint64_t operator()(uint32_t node) const { return masks[node]; }
};

struct SameNode {
  LinkedNodes links;
  VOXDAG_HD bool operator()(uint32_t a, uint32_t b) const {
    const uint32_t mask = links.nodes.masks[a];
    if (mask != links.nodes.masks[b]) return false;
    const uint32_t count = static_cast<uint32_t>(popcount64(mask));
    for (uint32_t rank = 0; rank < count; ++rank)
      if (links.child(a, rank) != links.child(b, rank)) return false;
    return true;
  }
};

// Copies the first item of each group of equal items. The item at sorted position i is in group
// marked[i + 1] - 1.
struct TakeFirstOfEquals {
  const uint32_t* marked;  // prefix sums of the marks of MarkFirstOfEquals
  const uint32_t* items;
  uint32_t* firsts;
  VOXDAG_HD void operator()(uint32_t i) const {
    if (marked[i + 1] != marked[i]) firsts[marked[i]] = items[i];
  }
};

// Sets index_of[item], for each item, to the position of the item's group among the survivors.
struct RewireThroughGroups {
  const uint32_t* marked;
  const uint32_t* items;
  const uint32_t* place_of_group;
  uint32_t* index_of;
  VOXDAG_HD void operator()(uint32_t i) const {
    index_of[items[i]] = place_of_group[marked[i + 1] - 1];
  }
};

struct HashSurvivorBrick {
  const uint64_t* masks;
  uint32_t hash_bits;
  const uint32_t* survivors;
  uint64_t* hashes;
  VOXDAG_HD void operator()(uint32_t i) const {
    hashes[i] = truncate_hash(hash_brick(masks[survivors[i]]), hash_bits);
  }
};

struct HashSurvivorNode {
  LinkedNodes links;
  const uint64_t* child_hashes;  // hashes of the survivors below
  uint32_t hash_bits;
  const uint32_t* survivors;
  uint64_t* hashes;
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint32_t node = survivors[i], mask = links.nodes.masks[node];
    const uint32_t count = static_cast<uint32_t>(popcount64(mask));
    uint64_t hash = node_hash_begin(mask);
    for (uint32_t rank = 0; rank < count; ++rank)
      hash = node_hash_add(hash, child_hashes[links.child(node, rank)]);
    hashes[i] = truncate_hash(node_hash_end(hash), hash_bits);
  }
};

struct EmitChildren {
  LinkedNodes links;
  const uint32_t* survivors;
  uint32_t* children;
  VOXDAG_HD void operator()(uint32_t source, uint32_t rank, uint32_t output) const {
    children[output] = links.child(survivors[source], rank);
  }
};

// Removes duplicates from a level. `order` has the level's octree nodes sorted by mask and
// children, so equal nodes are neighbors. hash(survivors, hashes) returns a functor that sets
// hashes[i] to the hash of octree node survivors[i].
template <class Space, class Same, class MakeHash>
Reduced<Space> reduce_sorted(Space& space, const Order<Space>& order, Same same, uint32_t hash_bits,
                             MakeHash hash) {
  const uint32_t n = order.count();
  SpaceArray<Space, uint32_t> marked(space, n + 1);
  space.for_each(n, MarkFirstOfEquals<Same>{same, order.items(), marked.data()});
  space.scan(marked.data(), n);
  Reduced<Space> out;
  out.count = space.value(marked.data() + n);
  SpaceArray<Space, uint32_t> firsts(space, out.count);
  space.for_each(n, TakeFirstOfEquals{marked.data(), order.items(), firsts.data()});
  SpaceArray<Space, uint64_t> hashes(space, out.count);
  space.for_each(out.count, hash(firsts.data(), hashes.data()));

  Order<Space> by_hash(space, out.count);
  by_hash.sort_by(KeyAt{hashes.data()}, {.begin = first_hash_bit(hash_bits), .end = 64});
  out.survivors = gather<uint32_t>(space, out.count, by_hash.items(), firsts.data());
  out.hashes = gather<uint64_t>(space, out.count, by_hash.items(), hashes.data());
  const SpaceArray<Space, uint32_t> place_of_group = by_hash.places();
  out.index_of = SpaceArray<Space, uint32_t>(space, n);
  space.for_each(n, RewireThroughGroups{marked.data(), order.items(), place_of_group.data(),
                                        out.index_of.data()});
  return out;
}

template <class Space>
Reduced<Space> reduce_bricks(Space& space, const Octree<Space>& tree, uint32_t hash_bits) {
  const uint64_t* masks = tree.brick_masks.data();
  Order<Space> order(space, tree.brick_count);
  order.sort_by(KeyAt{masks}, {.begin = 0, .end = 64});
  return reduce_sorted(space, order, SameWord{masks}, hash_bits,
                       [&](const uint32_t* survivors, uint64_t* hashes) {
                         return HashSurvivorBrick{masks, hash_bits, survivors, hashes};
                       });
}

// Removes duplicates from a level above the bricks. `child_hashes`: the hashes of the `child_count`
// survivors of the level below.
template <class Space>
Reduced<Space> reduce_nodes(Space& space, uint32_t node_count, const LinkedNodes& links,
                            const uint64_t* child_hashes, uint32_t child_count,
                            uint32_t hash_bits) {
  Order<Space> order(space, node_count);
  const int bits = std::bit_width(child_count);  // pointers range from 0 (none) to child_count
  const uint32_t slots = std::min(8u, 64u / static_cast<uint32_t>(bits));
  for (uint32_t end = 8; end > 0;) {
    const uint32_t first = end > slots ? end - slots : 0;
    order.sort_by(PointerKey{links, first, end, bits},
                  {.begin = 0, .end = bits * static_cast<int>(end - first)});
    end = first;
  }
  order.sort_by(MaskKey{links.nodes.masks}, {.begin = 0, .end = 8});
  return reduce_sorted(space, order, SameNode{links}, hash_bits,
                       [&](const uint32_t* survivors, uint64_t* hashes) {
                         return HashSurvivorNode{links, child_hashes, hash_bits, survivors, hashes};
                       });
}

// Returns the level array of the surviving nodes.
template <class Space>
DagLevel<Space> make_level(Space& space, const LinkedNodes& links, Reduced<Space>& reduced) {
  DagLevel<Space> level;
  const uint32_t* survivors = reduced.survivors.data();
  level.count = reduced.count;
  level.hashes = std::move(reduced.hashes);
  level.masks = gather<uint8_t>(space, level.count, survivors, links.nodes.masks);
  SpaceArray<Space, uint32_t> offsets(space, level.count + 1);
  space.for_each(level.count, CountChildren{links.nodes, survivors, offsets.data()});
  space.scan(offsets.data(), level.count);
  level.child_count = space.value(offsets.data() + level.count);
  level.children = SpaceArray<Space, uint32_t>(space, level.child_count);
  space.expand(offsets.data(), 0, level.count, level.child_count,
               EmitChildren{links, survivors, level.children.data()});
  return level;
}

template <class Space>
SpaceDag<Space> make_dag_by_pointers(Space& space, const Octree<Space>& tree, uint32_t hash_bits) {
  SpaceDag<Space> dag;
  Reduced<Space> reduced = reduce_bricks(space, tree, hash_bits);
  dag.bricks.count = reduced.count;
  dag.bricks.masks =
      gather<uint64_t>(space, reduced.count, reduced.survivors.data(), tree.brick_masks.data());
  const SpaceArray<Space, uint64_t> brick_hashes = std::move(reduced.hashes);
  const uint64_t* child_hashes = brick_hashes.data();
  for (const OctreeLevel<Space>& level : tree.levels) {
    const LinkedNodes links{{level.first_child.data(), level.masks.data()},
                            reduced.index_of.data()};
    Reduced<Space> here =
        reduce_nodes(space, level.count, links, child_hashes, reduced.count, hash_bits);
    dag.levels.push_back(make_level(space, links, here));
    child_hashes = dag.levels.back().hashes.data();
    reduced = std::move(here);
  }
  dag.root_hash = space.value(child_hashes);
  return dag;
}

}  // namespace voxdag::parallel
