// Functions that BrickTable and NodeTable share: they compute the number of slots, and sort the
// slots, which linear probing leaves nearly in the order of their hashes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxdag {

// Returns the maximum number of entries in a table of `slots` slots: 5/8 of the slots. The number
// of slots is a power of two.
inline uint64_t entries_for(uint64_t slots) { return slots / 8 * 5; }
// Returns the smallest number of slots that can hold `entries` entries; at least 512.
inline uint64_t slots_for(uint64_t entries) {
  uint64_t slots = 512;
  while (entries > entries_for(slots)) slots *= 2;
  return slots;
}

// Moves the used slots to the front and returns them. Their order does not change, with one
// exception. If the last slots were taken, linear probing has put entries with the highest hashes
// into the first slots. These entries are moved behind all others. `tag(slot)` is the upper half of
// the hash.
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
  // Writes every slot without a branch, which would be mispredicted half the time. If the slot is
  // unused, the next write replaces it.
  for (; i < slots.size(); ++i) {
    const bool used = in_use(slots[i]);
    slots[count] = slots[i];
    count += used;
  }
  std::copy(wrapped.begin(), wrapped.end(), slots.begin() + count);
  return slots.first(count + wrapped.size());
}

// Sorts slots by tag and, for equal tags, by less(a, b). This is fast if no slot is far from its
// final position. With linear probing, the distance is at most the length of the longest run of
// consecutive used slots. `tag(slot)` is the upper half of the hash.
template <class Slot, class Tag, class Less>
void sort_nearly_sorted(std::span<Slot> slots, Tag tag, Less less) {
  if (slots.empty()) return;
  // First pass, from the back to the front: carries a slot toward the front until it meets a slot
  // whose tag is not larger, then carries that slot instead. This does most of the work, almost
  // without branches.
  Slot down = slots.back();
  for (size_t i = slots.size() - 1; i-- > 0;) {
    const Slot other = slots[i];
    const bool passes = tag(down) < tag(other);
    slots[i + 1] = passes ? other : down;
    down = passes ? down : other;
  }
  slots.front() = down;
  // Second pass: insertion sort.
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

}  // namespace voxdag
