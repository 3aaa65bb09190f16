// Takes two nodes whose cubes have a common face. Finds all pairs of components (space_labels.h),
// one of each node, that meet at this face.
//
// The pairs are computed from the pairs of the octants at the face. A cache remembers the pairs of
// recent nodes, because equal nodes are often neighbors of equal nodes. The cache only saves time:
// a lost entry is computed again. Not thread-safe.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>

#include "core/dag/space/space_labels.h"

namespace voxdag {

class FaceRelations {
 public:
  static constexpr uint32_t kMaxComponents = 8;

  // Bit 8 i + j of `pairs` is set if component i of the node `low` of find() meets component j of
  // the node `high`.
  struct Meeting {
    uint64_t pairs = 0;
  };
  static int lowest_pair(uint64_t pairs) { return std::countr_zero(pairs); }
  static uint32_t of_low(int pair) { return static_cast<uint32_t>(pair) / kMaxComponents; }
  static uint32_t of_high(int pair) { return static_cast<uint32_t>(pair) % kMaxComponents; }

  // `labels` must have the labels of the depths that are passed to find(). Throws OutOfBudget.
  FaceRelations(PooledMemory& memory, const SpaceLabels& labels);

  // Returns the pairs of two nodes or bricks at rows `low` and `high` of a depth. The cube of `low`
  // is the lower neighbor, along `axis`, of the cube of `high`. Returns nullopt if one of the two
  // nodes, or one of the smaller cubes at the face, has more than kMaxComponents components.
  std::optional<Meeting> find(int depth, uint32_t low, uint32_t high, int axis);

 private:
  struct Entry {
    uint64_t pairs = 0;
    uint32_t low = 0, high = 0;
    uint32_t tag = 0;  // depth and axis; 0: the entry is free
  };

  // Returns the set of a node's components that have a voxel at a face, as bits.
  uint32_t at_face(int depth, uint32_t row, int face) const;
  Meeting meet_bricks(uint32_t low, uint32_t high, int axis) const;
  std::optional<Meeting> meet_octants(int depth, uint32_t low, uint32_t high, int axis);
  // Returns the pairs of octant `o` of node `low` and octant `p` of node `high`, as pairs of the
  // octants' components.
  std::optional<Meeting> meet_pair(int depth, uint32_t low, int o, uint32_t high, int p, int axis);

  const SpaceLabels& labels_;
  uint64_t slots_;
  PooledArray<Entry> cache_;
};

}  // namespace voxdag
