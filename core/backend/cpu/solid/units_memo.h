// A cache from voxel blocks (8^3 voxels) to the units of their empty voxels
// (core/geometry/solid_rule.h). The units of a block depend only on its voxels. Most blocks of a
// scene occur more than once, and a lookup is faster than a search for components. The cache stores
// only blocks that have one or two units, none of them blind (solid_rule.h). Most blocks that
// surfaces cross are such blocks.
//
// The cache is direct-mapped: a new block replaces the block in its slot. All bytes of a block are
// compared, so a hit is correct even if different blocks have the same key. When most lookups miss,
// as for scanned 3D models, the cache is not used for a while.
//
// The cache is charged to the budget, and is omitted if its part of the budget is too small. Not
// thread-safe. Throws OutOfBudget.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/memo_gate.h"
#include "core/backend/cpu/raster/voxel_block.h"
#include "core/base/host_device.h"
#include "core/dag/consing/pooled_memory.h"

namespace voxdag::cpu {

class UnitsMemo {
 public:
  // The units of a block: the empty voxels in `first`, and all other empty voxels. If the block has
  // only one unit, it is the second unit, and `first` is empty.
  struct Units {
    VoxelBlock first;
    uint8_t corners[2];  // corners of each unit, as a bit set by child index
    uint16_t voxels[2];  // number of voxels of each unit
  };

  explicit UnitsMemo(PooledMemory& memory);

  // True if the memo should be used for the next `count` blocks, which count as lookups.
  bool is_worthwhile(int count) { return slots_ != 0 && gate_.is_open(count); }
  VOXDAG_PREFETCH void prefetch(uint64_t key) const {
    __builtin_prefetch(&blocks_[slot_of(key)]);
    __builtin_prefetch(&units_[slot_of(key)]);
  }
  // Returns the units of a block, or null if the block is not in the memo. The block must not be
  // empty, because a free slot looks like an empty block. `key`: block_key() of the block.
  const Units* find(uint64_t key, const VoxelBlock& block) const {
    const uint64_t slot = slot_of(key);
    uint64_t differ = 0;
    for (int i = 0; i < kBlockBricks; ++i) differ |= blocks_[slot].bricks[i] ^ block.bricks[i];
    return differ == 0 ? &units_[slot] : nullptr;
  }
  // Call it after each find() that returned null.
  void count_miss() { gate_.count_miss(); }
  void insert(uint64_t key, const VoxelBlock& block, const Units& units) {
    const uint64_t slot = slot_of(key);
    blocks_[slot] = block;
    units_[slot] = units;
  }

 private:
  uint64_t slot_of(uint64_t key) const { return key * 0x9e3779b97f4a7c15ull >> shift_; }

  PooledArray<VoxelBlock> blocks_;
  PooledArray<Units> units_;
  uint64_t slots_ = 0;  // 0 or a power of two
  int shift_ = 0;
  MemoGate gate_;
};

}  // namespace voxdag::cpu
