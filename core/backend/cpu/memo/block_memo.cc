#include "core/backend/cpu/memo/block_memo.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/backend/backend_memory.h"

namespace voxdag::cpu {
namespace {

constexpr uint64_t kMinBlockSlots = 64;
constexpr uint64_t kFirstSlots = 4096;
constexpr uint64_t kMaxBlockSlots = uint64_t{1} << 16;  // 5 MiB; more would exceed the CPU caches

}  // namespace

BlockMemo::BlockMemo(PooledMemory& memory) : memory_(memory) {
  set_slots(fits_budget(kFirstSlots) ? kFirstSlots : kMinBlockSlots);
}

bool BlockMemo::fits_budget(uint64_t slots) const {
  return slots * (sizeof(VoxelBlock) + sizeof(Node)) <=
         BackendMemory::block_memo_bytes(memory_.budget.available());
}

void BlockMemo::set_slots(uint64_t slots) {
  blocks_ = PooledArray<VoxelBlock>(memory_, slots, PooledArray<VoxelBlock>::kZero);
  nodes_ = PooledArray<Node>(memory_, slots);
  slots_ = slots;
  shift_ = 64 - std::countr_zero(slots);
}

void BlockMemo::grow() {
  inserted_ = 0;
  const uint64_t old_slots = slots_, slots = 4 * slots_;
  if (slots > kMaxBlockSlots || !fits_budget(slots)) return;
  const PooledArray<VoxelBlock> blocks = std::move(blocks_);
  const PooledArray<Node> nodes = std::move(nodes_);
  set_slots(slots);
  for (uint64_t i = 0; i < old_slots; ++i) {
    const uint64_t slot = slot_of(block_key(blocks[i]));
    blocks_[slot] = blocks[i];
    nodes_[slot] = nodes[i];
  }
}

}  // namespace voxdag::cpu
