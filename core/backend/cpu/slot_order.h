// What the two hash tables share: how many slots they have, and how their slots, which linear
// probing leaves nearly in the order of the hash, become sorted arrays.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxdag::cpu {

// Slots are at most 5/8 full, and a power of two.
inline uint64_t entries_for(uint64_t slots) { return slots / 8 * 5; }
inline uint64_t slots_for(uint64_t entries) {
  uint64_t slots = 512;
  while (entries > entries_for(slots)) slots *= 2;
  return slots;
}

// Moves the slots in use to the front, keeping their order, but those that probing carried around
// the end of the table to the back, where they belong. `tag(slot)` is the upper half of the hash.
template <class Slot, class InUse, class Tag>
std::span<Slot> compact_slots(std::span<Slot> slots, InUse in_use, Tag tag) {
  std::vector<Slot> wrapped;
  size_t count = 0;
  for (size_t i = 0; i < slots.size(); ++i) {
    if (!in_use(slots[i])) continue;
    if (tag(slots[i]) >> 31 && i < slots.size() / 4)
      wrapped.push_back(slots[i]);
    else
      slots[count++] = slots[i];
  }
  std::copy(wrapped.begin(), wrapped.end(), slots.begin() + count);
  return slots.first(count + wrapped.size());
}

// Insertion sort: no slot is further from its place than a cluster of the table is long.
template <class Slot, class Less>
void sort_nearly_sorted(std::span<Slot> slots, Less less) {
  for (size_t i = 1; i < slots.size(); ++i) {
    if (!less(slots[i], slots[i - 1])) continue;
    const Slot slot = slots[i];
    size_t at = i;
    for (; at > 0 && less(slot, slots[at - 1]); --at) slots[at] = slots[at - 1];
    slots[at] = slot;
  }
}

}  // namespace voxdag::cpu
