// A cache from voxel blocks (8^3 voxels, eight bricks in 64 bytes) to their nodes. Most blocks of a
// scene occur more than once. For a repeated block, one comparison replaces a lookup of each brick
// and of the node.
//
//   blocks    64 bytes each; all 0 if the slot is free
//   nodes     the node of the block in the same slot
//
// The cache is direct-mapped: a new block replaces the block in its slot. All bytes of a block are
// compared, so a hit is correct even if different blocks have the same key. When most lookups miss,
// the cache is not used for a while. This happens for scanned 3D models, where almost no blocks are
// equal.
//
// The cache is charged to the budget. It grows beyond its minimum size only up to 5 MiB, and only
// up to a sixteenth of the memory that is still free in the budget. Throws OutOfBudget if not even
// the minimum size fits. Not thread-safe.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/memo_gate.h"
#include "core/backend/cpu/raster/voxel_block.h"
#include "core/base/host_device.h"
#include "core/dag/consing/pooled_memory.h"

namespace voxdag::cpu {

class BlockMemo {
 public:
  struct Node {
    uint64_t hash;
    uint32_t id;
    uint16_t voxels;
    uint16_t bricks;
  };

  explicit BlockMemo(PooledMemory& memory);

  // True if the memo should be used for the next `count` blocks, which count as lookups.
  bool is_worthwhile(int count) { return gate_.is_open(count); }
  VOXDAG_PREFETCH void prefetch(uint64_t key) const { __builtin_prefetch(&blocks_[slot_of(key)]); }
  // Returns the node of a block, or null if the block is not in the memo. The block must not be
  // empty, because a free slot looks like an empty block. `key`: block_key() of the block.
  const Node* find(uint64_t key, const VoxelBlock& block) const {
    const uint64_t slot = slot_of(key);
    uint64_t differ = 0;
    for (int i = 0; i < kBlockBricks; ++i) differ |= blocks_[slot].bricks[i] ^ block.bricks[i];
    return differ == 0 ? &nodes_[slot] : nullptr;
  }
  void insert(uint64_t key, const VoxelBlock& block, const Node& node) {
    const uint64_t slot = slot_of(key);
    blocks_[slot] = block;
    nodes_[slot] = node;
    gate_.count_miss();
    if (++inserted_ == slots_) grow();
  }

 private:
  uint64_t slot_of(uint64_t key) const { return key * 0x9e3779b97f4a7c15ull >> shift_; }
  bool fits_budget(uint64_t slots) const;
  void set_slots(uint64_t slots);
  // Quadruples the number of slots, if the budget and the maximum number of slots allow it.
  void grow();

  PooledMemory& memory_;
  PooledArray<VoxelBlock> blocks_;
  PooledArray<Node> nodes_;
  uint64_t slots_ = 0;     // a power of two
  uint64_t inserted_ = 0;  // blocks inserted since the last growth
  int shift_ = 0;
  MemoGate gate_;
};

}  // namespace voxdag::cpu
