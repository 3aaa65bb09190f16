#include "core/dag/consing/brick_table.h"

#include "core/base/host_device.h"
#include "core/dag/consing/slot_order.h"
#include "core/dag/node_hash.h"

namespace voxdag {

void BrickTable::grow(uint64_t bricks) {
  if (bricks > UINT32_MAX) throw OutOfBudget{};
  PooledArray<Slot> old = std::move(slots_);
  slots_ = PooledArray<Slot>(memory_, slots_for(bricks), PooledArray<Slot>::kZero);
  capacity_ = entries_for(slots_.size());
  shift_ = 64 - lowest_bit(slots_.size());
  for (const Slot& slot : old) {
    if (slot.mask == 0) continue;
    uint64_t at = uint64_t{slot.tag} << 32 >> shift_;
    while (slots_[at].mask != 0) at = (at + 1) & (slots_.size() - 1);
    slots_[at] = slot;
  }
}

std::span<const BrickTable::Slot> BrickTable::sort_slots(uint32_t hash_bits) {
  const auto tag = [](const Slot& slot) { return slot.tag; };
  const std::span<Slot> slots = compact_slots(
      std::span(slots_.begin(), slots_.end()), [](const Slot& slot) { return slot.mask != 0; },
      tag);
  const auto less = [hash_bits](const Slot& a, const Slot& b) {
    const uint64_t hash_a = truncate_hash(hash_brick(a.mask), hash_bits);
    const uint64_t hash_b = truncate_hash(hash_brick(b.mask), hash_bits);
    return hash_a != hash_b ? hash_a < hash_b : a.mask < b.mask;
  };
  if (hash_bits < 64)
    std::sort(slots.begin(), slots.end(), less);
  else
    sort_nearly_sorted(slots, tag, less);
  return slots;
}

}  // namespace voxdag
