// A cache of filled voxel blocks. The block's interior depends on the block's voxels and on the
// views (core/geometry/solid_rule.h) from its eight corners. Most blocks of a flat surface occur
// repeatedly.
//
// The cache is direct-mapped. The complete input is compared, so a hit is exact. Not thread-safe.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/voxel_block.h"
#include "core/dag/consing/pooled_memory.h"

namespace voxdag::cpu {

class FillMemo {
 public:
  // The sum of the three views (core/geometry/solid_rule.h) from each corner of a block, in the
  // order of child indices.
  struct Views {
    int32_t of[8];
    bool operator==(const Views&) const = default;
  };
  struct Filled {
    VoxelBlock block;  // with the interior
    uint16_t filled;
    uint16_t disputed;
  };

  // Charges the cache to the budget. Throws OutOfBudget.
  explicit FillMemo(PooledMemory& memory) : entries_(memory, kSlots, PooledArray<Entry>::kZero) {}

  // Returns the result for a block, which must not be empty, or null.
  const Filled* find(const VoxelBlock& shell, const Views& views) const {
    const Entry& entry = entries_[slot_of(shell, views)];
    uint64_t differ = 0;
    for (int i = 0; i < kBlockBricks; ++i) differ |= entry.shell.bricks[i] ^ shell.bricks[i];
    return differ == 0 && entry.views == views ? &entry.result : nullptr;
  }
  void insert(const VoxelBlock& shell, const Views& views, const Filled& result) {
    entries_[slot_of(shell, views)] = {shell, result, views};
  }

 private:
  struct Entry {
    VoxelBlock shell;  // all 0: free
    Filled result;
    Views views;
  };
  static constexpr int kSlotsLog2 = 11;
  static constexpr uint64_t kSlots = uint64_t{1} << kSlotsLog2;

  static uint64_t slot_of(const VoxelBlock& shell, const Views& views) {
    uint64_t key = block_key(shell);
    for (const int32_t view : views.of) key = key * 31 + static_cast<uint32_t>(view);
    return key * 0x9e3779b97f4a7c15ull >> (64 - kSlotsLog2);
  }

  PooledArray<Entry> entries_;
};

}  // namespace voxdag::cpu
