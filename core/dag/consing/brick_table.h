// The unique bricks of one subvolume: an open-addressing table from masks to ids 0, 1, 2, ...
//
// The number of a brick's slot is the top bits of its hash. If that slot is taken, the brick gets
// the next free slot (linear probing). So the slots are almost in the order of the hashes. The
// table therefore grows in one sequential pass, and sort_slots(), which makes the level array, only
// has to sort a nearly sorted array. Not thread-safe. Throws OutOfBudget if the budget is too
// small.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/host_device.h"
#include "core/dag/consing/pooled_memory.h"

namespace voxdag {

class BrickTable {
 public:
  struct Slot {
    uint64_t mask;  // 0: free slot
    uint32_t id;
    uint32_t tag;  // top half of the brick's hash
  };

  explicit BrickTable(PooledMemory& memory) : memory_(memory) {}

  uint64_t size() const { return count_; }

  // Reserves slots for `more` bricks beyond size(). The functions below do not reserve slots.
  void reserve(uint64_t more) {
    if (count_ + more > capacity_) grow(count_ + more);
  }

  VOXDAG_PREFETCH void prefetch(uint64_t hash) const {
    __builtin_prefetch(&slots_[hash >> shift_]);
  }

  // Returns the id of the brick; adds the brick if it is new. Requires mask != 0, and that `hash`
  // is hash_brick(mask).
  uint32_t find_or_add(uint64_t mask, uint64_t hash) {
    uint64_t at = hash >> shift_;
    while (true) {
      Slot& slot = slots_[at];
      if (slot.mask == mask) return slot.id;
      if (slot.mask == 0) {
        slot = {mask, static_cast<uint32_t>(count_), static_cast<uint32_t>(hash >> 32)};
        return static_cast<uint32_t>(count_++);
      }
      at = (at + 1) & (slots_.size() - 1);
    }
  }

  // Calls visit(mask, id) for every brick, in no particular order.
  template <class Visit>
  void for_each(Visit visit) {
    for (const Slot& slot : slots_)
      if (slot.mask != 0) visit(slot.mask, slot.id);
  }

  // Returns all used slots, sorted by (hash truncated to `hash_bits`, mask). After this call, the
  // table cannot be searched.
  std::span<const Slot> sort_slots(uint32_t hash_bits);

 private:
  void grow(uint64_t bricks);

  PooledMemory& memory_;
  PooledArray<Slot> slots_;
  uint64_t capacity_ = 0;
  int shift_ = 64;  // slot of a hash = hash >> shift_
  uint64_t count_ = 0;
};

}  // namespace voxdag
