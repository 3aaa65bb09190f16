// What the two hash tables share: how many slots they have, and how their slots, which linear
// probing leaves nearly in the order of the hash, become sorted arrays.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxdag::cpu {

// ConcurrencyLimiter are at most 5/8 full, and a power of two.
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
  size_t count = 0, i = 0;
  for (; i < slots.size() && in_use(slots[i]); ++i) {
    if (tag(slots[i]) >> 31)
      wrapped.push_back(slots[i]);
    else
      slots[count++] = slots[i];
  }
  // Written in any case, kept if it is in use: the processor would guess wrong every other time.
  for (; i < slots.size(); ++i) {
    const bool kept = in_use(slots[i]);
    slots[count] = slots[i];
    count += kept;
  }
  std::copy(wrapped.begin(), wrapped.end(), slots.begin() + count);
  return slots.first(count + wrapped.size());
}

// No slot is further from its place than a cluster of the table is long. `tag` as above; `less`
// agrees with it.
template <class Slot, class Tag, class Less>
void sort_nearly_sorted(std::span<Slot> slots, Tag tag, Less less) {
  if (slots.empty()) return;
  // Most of the work, hardly with branches: each slot goes down past all with larger tags, until
  // another goes down from there.
  Slot down = slots.back();
  for (size_t i = slots.size() - 1; i-- > 0;) {
    const Slot other = slots[i];
    const bool passes = tag(down) < tag(other);
    slots[i + 1] = passes ? other : down;
    down = passes ? down : other;
  }
  slots.front() = down;
  // The rest: insertion sort.
  for (size_t i = 1; i < slots.size(); ++i) {
    const auto before = tag(slots[i - 1]), here = tag(slots[i]);
    if (before < here) continue;
    const Slot slot = slots[i];
    const auto is_less = [&](const Slot& other) {
      return here != tag(other) ? here < tag(other) : less(slot, other);
    };
    size_t at = i;
    for (; at > 0 && is_less(slots[at - 1]); --at) slots[at] = slots[at - 1];
    slots[at] = slot;
  }
}

}  // namespace voxdag::cpu
