// Builds the octree of a subvolume from its sorted brick codes, from the bottom up, as in Sintorn,
// "DAG Construction" (2018). For each level it marks the first child of each parent, selects the
// positions of the marks, and computes the child masks.
//
// Because codes are sorted, the children of a node are consecutive in the level below. So a node is
// stored as its child mask and the position of its first child.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/backend/parallel/space/brick_list.h"
#include "core/backend/parallel/space/space.h"
#include "core/base/host_device.h"

namespace voxdag::parallel {

template <class Space>
struct OctreeLevel {
  uint32_t count = 0;
  SpaceArray<Space, uint32_t> first_child;
  SpaceArray<Space, uint8_t> masks;
};

// Pointers to the arrays of an OctreeLevel, for functors.
struct OctreeNodes {
  const uint32_t* first_child;
  const uint8_t* masks;
};

template <class Space>
struct Octree {
  uint32_t brick_count = 0;
  SpaceArray<Space, uint64_t> brick_masks;
  std::vector<OctreeLevel<Space>> levels;  // from the bricks' parents up to the root

  uint64_t node_count() const {
    uint64_t count = brick_count;
    for (const auto& level : levels) count += level.count;
    return count;
  }
};

// Computes the child mask and code of the node whose children begin at first_child[i].
struct MakeParent {
  const uint64_t* codes;
  uint32_t child_count, parent_count;  // numbers of nodes in the level below and in this level
  const uint32_t* first_child;
  uint8_t* masks;
  uint64_t* parent_codes;
  VOXDAG_HD void operator()(uint32_t i) const {
    const uint32_t first = first_child[i];
    const uint32_t end = i + 1 < parent_count ? first_child[i + 1] : child_count;
    uint32_t mask = 0;
    for (uint32_t c = first; c < end; ++c) mask |= 1u << (codes[c] & 7);
    masks[i] = static_cast<uint8_t>(mask);
    parent_codes[i] = codes[first] >> 3;
  }
};

// Creates `level_count` levels above the bricks. `bricks` must be sorted by code, without
// duplicates (see BrickList::merge()), and not empty; its arrays are moved out.
template <class Space>
Octree<Space> make_octree(Space& space, BrickList<Space>& bricks, uint32_t level_count) {
  Octree<Space> tree;
  tree.brick_count = bricks.size();
  SpaceArray<Space, uint64_t> codes = bricks.take_codes();
  tree.brick_masks = bricks.take_masks();
  uint32_t child_count = tree.brick_count;
  for (uint32_t l = 0; l < level_count; ++l) {
    SpaceArray<Space, uint32_t> first_child(space, child_count);
    OctreeLevel<Space> level;
    {
      SpaceArray<Space, uint8_t> flags(space, child_count);
      space.for_each(child_count, MarkFirstOfCube{codes.data(), 3, flags.data()});
      level.count = space.select(flags.data(), child_count, first_child.data());
    }
    level.first_child = SpaceArray<Space, uint32_t>(space, level.count);
    space.copy(first_child.data(), level.first_child.data(), level.count);
    first_child = {};
    level.masks = SpaceArray<Space, uint8_t>(space, level.count);
    SpaceArray<Space, uint64_t> parent_codes(space, level.count);
    space.for_each(level.count,
                   MakeParent{codes.data(), child_count, level.count, level.first_child.data(),
                              level.masks.data(), parent_codes.data()});
    codes = std::move(parent_codes);
    child_count = level.count;
    tree.levels.push_back(std::move(level));
  }
  return tree;
}

}  // namespace voxdag::parallel
