// What a build remembers of blocks: cubes of 8 voxels, whose eight bricks are 64 bytes. Most blocks
// of a scene have been there before; one comparison then stands for a look-up of each of their
// bricks and one of their node.
//
//   blocks    64 bytes each; all 0: free
//   nodes     what the block of the same slot became
//
// Direct-mapped: a block that meets another one in its slot takes its place. Blocks are compared
// whole, so what is found is right whatever their keys. Where few are found it is left alone for a
// while: scans have hardly two blocks alike. Charged to the budget, of which it takes a sixteenth
// at most beyond its least size.
// Not thread-safe. Throws Outgrown when not even its least size fits.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/voxel_block.h"
#include "core/backend/cpu/memory.h"

namespace voxdag::cpu {

class BlockMemo {
 public:
  struct Node {
    uint64_t hash;
    uint32_t id;
    uint16_t voxels;
    uint16_t bricks;
  };

  explicit BlockMemo(Memory& memory);

  // Whether to ask for the next `count` blocks at all.
  bool pays(int count) {
    if (resting_ > 0) {
      resting_ -= count;
      return false;
    }
    asked_ += count;
    if (asked_ >= kWindow) {
      if (missed_ > asked_ - asked_ / 4) resting_ = kRest;
      asked_ = missed_ = 0;
    }
    return true;
  }
  void prefetch(uint64_t key) const { __builtin_prefetch(&blocks_[slot_of(key)]); }
  // Null if the block, which is not empty, is not remembered.
  const Node* find(uint64_t key, const Block& block) const {
    const uint64_t slot = slot_of(key);
    uint64_t differ = 0;
    for (int i = 0; i < kBlockBricks; ++i) differ |= blocks_[slot].bricks[i] ^ block.bricks[i];
    return differ == 0 ? &nodes_[slot] : nullptr;
  }
  void remember(uint64_t key, const Block& block, const Node& node) {
    const uint64_t slot = slot_of(key);
    blocks_[slot] = block;
    nodes_[slot] = node;
    ++missed_;
    if (++remembered_ == slots_) grow();
  }

 private:
  static constexpr int64_t kWindow = 1024;  // blocks
  static constexpr int64_t kRest = 16 * kWindow;

  uint64_t slot_of(uint64_t key) const { return key * 0x9e3779b97f4a7c15ull >> shift_; }
  bool affordable(uint64_t slots) const;
  void set_slots(uint64_t slots);
  // Four times the slots, if the budget has room.
  void grow();

  Memory& memory_;
  Buffer<Block> blocks_;
  Buffer<Node> nodes_;
  uint64_t slots_ = 0;       // a power of two
  uint64_t remembered_ = 0;  // since the last growth
  int shift_ = 0;
  int64_t asked_ = 0, missed_ = 0;  // in this window
  int64_t resting_ = 0;             // blocks for which it is left alone
};

}  // namespace voxdag::cpu
