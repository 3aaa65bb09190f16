// The second DAG construction of Sintorn, "DAG Construction" (2018). First, every octree node is
// hashed, from the leaves up. Then, from the top down, the nodes of each level that still have a
// parent are sorted by hash, duplicates are removed and the parents are rewired. Children of
// removed nodes are never visited, so the cost of sorting is proportional to the largest level of
// the DAG, not of the octree.
//
// A verification sweep makes the result exact. On every level the sweep compares every octree node,
// removed or not, with the remaining node of the same hash. It compares the masks of bricks, and
// the child masks and lists of child hashes of the nodes above the bricks. If all compared nodes
// agree, octree nodes with equal hashes have equal subtrees. This follows by induction from the
// bricks: the children of two such nodes have equal hashes, so the children have equal subtrees.
// Then the remaining nodes of a level have different hashes, and the order of the hashes is the
// total order. After any mismatch, the DAG is made by pointers instead (dag_by_pointers.h).
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/backend/parallel/dag/dag.h"
#include "core/backend/parallel/space/order.h"
#include "core/backend/parallel/space/thread_block.h"

namespace voxdag::parallel {

struct HashOctreeNode {
  OctreeNodes nodes;
  const uint64_t* child_hashes;  // hashes of the octree's level below
  uint32_t hash_bits;
  uint64_t* hashes;
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint32_t mask = nodes.masks[i];
    hashes[i] = truncate_hash(hash_node(mask, child_hashes + nodes.first_child[i]), hash_bits);
  }
};

// Lists the candidates of a level, with their hashes. A candidate is a child of a survivor of the
// level above. The survivors of a level are its candidates without duplicates.
struct EmitCandidates {
  OctreeNodes nodes;
  const uint32_t* parents;  // octree nodes
  const uint64_t* hashes;   // hashes of the octree's level below
  uint32_t* candidates;
  uint64_t* candidate_hashes;
  VOXDAG_HD void operator()(uint32_t source, uint32_t rank, uint32_t output) const {
    const uint32_t child = nodes.first_child[parents[source]] + rank;
    candidates[output] = child;
    candidate_hashes[output] = hashes[child];
  }
};

// Copies the survivors of a level: the first candidate with each hash. Also replaces every
// candidate, in the child list of its parent, by the position of its survivor. The candidate at
// sorted index i has the original index items[i]. Its survivor has the position marked[i + 1] - 1.
struct RemoveDuplicates {
  const uint32_t* marked;  // prefix sums of the marks of MarkFirstOfEquals
  const uint32_t* items;
  const uint32_t* candidates;
  const uint64_t* candidate_hashes;
  uint32_t* survivors;
  uint64_t* hashes;
  uint32_t* children;  // child lists of the level above; one entry per candidate
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint32_t item = items[i], compact = marked[i + 1] - 1;
    children[item] = compact;
    if (marked[i + 1] == marked[i]) return;
    survivors[compact] = candidates[item];
    hashes[compact] = candidate_hashes[item];
  }
};

// Returns the position of `hash` in an ascending array of `count` hashes; `count` if it is absent.
VOXDAG_HD inline uint32_t find_hash(const uint64_t* hashes, uint32_t count, uint64_t hash) {
  uint32_t begin = 0, end = count;
  while (begin < end) {
    const uint32_t middle = begin + (end - begin) / 2;
    if (hashes[middle] < hash)
      begin = middle + 1;
    else
      end = middle;
  }
  return begin < count && hashes[begin] == hash ? begin : count;
}

struct VerifyBrick {
  const uint64_t* masks;
  uint32_t hash_bits;
  const uint64_t* survivor_hashes;
  const uint32_t* survivors;
  uint32_t survivor_count;
  uint32_t* mismatch;
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint64_t hash = truncate_hash(hash_brick(masks[i]), hash_bits);
    const uint32_t at = find_hash(survivor_hashes, survivor_count, hash);
    if (at == survivor_count || masks[survivors[at]] != masks[i]) raise_flag(mismatch);
  }
};

struct VerifyNode {
  OctreeNodes nodes;
  const uint64_t* hashes;        // hashes of the octree's level
  const uint64_t* child_hashes;  // hashes of the octree's level below
  const uint64_t* survivor_hashes;
  const uint32_t* survivors;
  uint32_t survivor_count;
  uint32_t* mismatch;
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint32_t at = find_hash(survivor_hashes, survivor_count, hashes[i]);
    if (at == survivor_count || !same(i, survivors[at])) raise_flag(mismatch);
  }
  VOXDAG_HD bool same(uint32_t a, uint32_t b) const {
    if (nodes.masks[a] != nodes.masks[b]) return false;
    const uint64_t* of_a = child_hashes + nodes.first_child[a];
    const uint64_t* of_b = child_hashes + nodes.first_child[b];
    const int count = popcount64(nodes.masks[a]);
    for (int rank = 0; rank < count; ++rank)
      if (of_a[rank] != of_b[rank]) return false;
    return true;
  }
};

// Returns the hashes of all octree nodes. Element 0 is for the bricks, element l + 1 for
// tree.levels[l].
template <class Space>
std::vector<SpaceArray<Space, uint64_t>> hash_octree(Space& space, const Octree<Space>& tree,
                                                     uint32_t hash_bits) {
  std::vector<SpaceArray<Space, uint64_t>> hashes;
  hashes.emplace_back(space, tree.brick_count);
  space.for_each(tree.brick_count, HashBrick{tree.brick_masks.data(), hash_bits, hashes[0].data()});
  for (const OctreeLevel<Space>& level : tree.levels) {
    SpaceArray<Space, uint64_t> here(space, level.count);
    space.for_each(level.count, HashOctreeNode{{level.first_child.data(), level.masks.data()},
                                               hashes.back().data(),
                                               hash_bits,
                                               here.data()});
    hashes.push_back(std::move(here));
  }
  return hashes;
}

// The nodes of one level of the octree that remain in the DAG.
template <class Space>
struct Survivors {
  uint32_t count = 0;
  SpaceArray<Space, uint32_t> nodes;   // octree nodes, in the order of their hashes
  SpaceArray<Space, uint64_t> hashes;  // ascending, no duplicates
};

// Returns the children of `parents` without duplicates. Sets the counts, masks and children of
// `level`, the level of `parents`.
template <class Space>
Survivors<Space> reduce_children(Space& space, const OctreeNodes& nodes,
                                 const Survivors<Space>& parents, const uint64_t* octree_hashes,
                                 uint32_t hash_bits, DagLevel<Space>& level) {
  level.count = parents.count;
  level.masks = gather<uint8_t>(space, parents.count, parents.nodes.data(), nodes.masks);
  SpaceArray<Space, uint32_t> offsets(space, parents.count + 1);
  space.for_each(parents.count, CountChildren{nodes, parents.nodes.data(), offsets.data()});
  space.scan(offsets.data(), parents.count);
  const uint32_t n = level.child_count = space.value(offsets.data() + parents.count);
  SpaceArray<Space, uint32_t> candidates(space, n);
  SpaceArray<Space, uint64_t> candidate_hashes(space, n);
  space.expand(offsets.data(), 0, parents.count, n,
               EmitCandidates{nodes, parents.nodes.data(), octree_hashes, candidates.data(),
                              candidate_hashes.data()});
  offsets = {};

  Order<Space> order(space, n);
  order.sort_by(KeyAt{candidate_hashes.data()}, {.begin = first_hash_bit(hash_bits), .end = 64});
  SpaceArray<Space, uint32_t> marked(space, n + 1);
  space.for_each(
      n, MarkFirstOfEquals<SameWord>{{candidate_hashes.data()}, order.items(), marked.data()});
  space.scan(marked.data(), n);
  Survivors<Space> out;
  out.count = space.value(marked.data() + n);
  out.nodes = SpaceArray<Space, uint32_t>(space, out.count);
  out.hashes = SpaceArray<Space, uint64_t>(space, out.count);
  level.children = SpaceArray<Space, uint32_t>(space, n);
  space.for_each(
      n, RemoveDuplicates{marked.data(), order.items(), candidates.data(), candidate_hashes.data(),
                          out.nodes.data(), out.hashes.data(), level.children.data()});
  return out;
}

// Returns the octree's root, the only survivor of its level.
template <class Space>
Survivors<Space> surviving_root(Space& space, const SpaceArray<Space, uint64_t>& root_hash) {
  Survivors<Space> root;
  root.count = 1;
  root.nodes = SpaceArray<Space, uint32_t>(space, 1);
  root.hashes = SpaceArray<Space, uint64_t>(space, 1);
  space.for_each(1, CountUp{root.nodes.data()});
  space.copy(root_hash.data(), root.hashes.data(), 1);
  return root;
}

// Returns the DAG, or nullopt if two different nodes have the same hash.
template <class Space>
std::optional<SpaceDag<Space>> make_dag_by_hashes(Space& space, const Octree<Space>& tree,
                                                  uint32_t hash_bits) {
  auto hashes = hash_octree(space, tree, hash_bits);
  SpaceArray<Space, uint32_t> mismatch(space, 1);
  const uint32_t none = 0;
  space.upload(&none, mismatch.data(), 1);
  Survivors<Space> survivors = surviving_root(space, hashes.back());
  SpaceDag<Space> dag;
  dag.root_hash = space.value(survivors.hashes.data());
  dag.levels.resize(tree.levels.size());
  for (size_t l = tree.levels.size(); l-- > 0;) {
    const OctreeLevel<Space>& level = tree.levels[l];
    const OctreeNodes nodes{level.first_child.data(), level.masks.data()};
    space.for_each(level.count, VerifyNode{nodes, hashes[l + 1].data(), hashes[l].data(),
                                           survivors.hashes.data(), survivors.nodes.data(),
                                           survivors.count, mismatch.data()});
    hashes.pop_back();
    Survivors<Space> below =
        reduce_children(space, nodes, survivors, hashes[l].data(), hash_bits, dag.levels[l]);
    dag.levels[l].hashes = std::move(survivors.hashes);
    survivors = std::move(below);
  }
  space.for_each(tree.brick_count,
                 VerifyBrick{tree.brick_masks.data(), hash_bits, survivors.hashes.data(),
                             survivors.nodes.data(), survivors.count, mismatch.data()});
  if (space.value(mismatch.data()) != 0) return std::nullopt;
  dag.bricks.count = survivors.count;
  dag.bricks.masks =
      gather<uint64_t>(space, survivors.count, survivors.nodes.data(), tree.brick_masks.data());
  return dag;
}

}  // namespace voxdag::parallel
