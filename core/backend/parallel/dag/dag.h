// The DAG of a subvolume in the memory of a space (space.h), as level arrays in the total order
// (core/dag/level_array.h).
#pragma once

#include <cstdint>
#include <vector>

#include "core/backend/parallel/dag/octree.h"
#include "core/backend/parallel/space/space.h"
#include "core/dag/node_hash.h"

namespace voxdag::parallel {

template <class Space>
struct DagBricks {
  uint32_t count = 0;
  SpaceArray<Space, uint64_t> masks;
};

template <class Space>
struct DagLevel {
  uint32_t count = 0, child_count = 0;
  SpaceArray<Space, uint64_t> hashes;  // truncated
  SpaceArray<Space, uint8_t> masks;
  SpaceArray<Space, uint32_t> children;  // positions in the level below
};

template <class Space>
struct SpaceDag {
  DagBricks<Space> bricks;
  std::vector<DagLevel<Space>> levels;  // from the bricks' parents up to the root
  uint64_t root_hash = 0;

  uint64_t node_count() const {
    uint64_t count = bricks.count;
    for (const auto& level : levels) count += level.count;
    return count;
  }
};

struct HashBrick {
  const uint64_t* masks;
  uint32_t hash_bits;
  uint64_t* hashes;
  VOXDAG_HD void operator()(uint32_t i) const {
    hashes[i] = truncate_hash(hash_brick(masks[i]), hash_bits);
  }
};

// Returns the number of the lowest bit that can be set in a truncated hash. Bits [64 - hash_bits,
// 64) can be set.
inline int first_hash_bit(uint32_t hash_bits) { return 64 - static_cast<int>(hash_bits); }

// Counts the children of each octree node in `items`. The prefix sums of these counts are the
// positions of the nodes' first children.
struct CountChildren {
  OctreeNodes nodes;
  const uint32_t* items;
  uint32_t* counts;
  VOXDAG_HD void operator()(uint32_t i) const {
    counts[i] = static_cast<uint32_t>(popcount64(nodes.masks[items[i]]));
  }
};

struct SameWord {
  const uint64_t* words;
  VOXDAG_HD bool operator()(uint32_t a, uint32_t b) const { return words[a] == words[b]; }
};

// Marks each item in a sorted list: 1 if it is the first item or differs from the item before it,
// else 0.
template <class Same>
struct MarkFirstOfEquals {
  Same same;
  const uint32_t* items;
  uint32_t* marks;
  VOXDAG_HD void operator()(uint32_t i) const {
    marks[i] = i == 0 || !same(items[i - 1], items[i]);
  }
};

}  // namespace voxdag::parallel
