#include "core/dag/consing/node_table.h"

#include <algorithm>
#include <cstring>

#include "core/dag/consing/slot_order.h"
#include "core/dag/level_array.h"

namespace voxdag {
namespace {

constexpr uint64_t kWordLimit = uint64_t{1} << 32;  // an id is a word index of 32 bits

}  // namespace

uint32_t NodeTable::add(uint64_t at, uint64_t hash, uint32_t mask, const uint32_t* children,
                        int child_count) {
  const uint32_t id = static_cast<uint32_t>(kFirstId + used_);
  Record added = record(id);
  added.set_hash(hash);
  added.words[2] = mask;
  // Always copies eight children, because a copy of constant size needs no loop. The next node
  // overwrites the surplus.
  std::memcpy(added.children(), children, 8 * sizeof(uint32_t));
  slots_[at] = hash >> 32 << 32 | id;
  used_ += Record::kWords + static_cast<uint64_t>(child_count);
  ++count_;
  return id;
}

void NodeTable::grow_slots(uint64_t nodes) {
  PooledArray<uint64_t> old = std::move(slots_);
  slots_ = PooledArray<uint64_t>(memory_, slots_for(nodes), PooledArray<uint64_t>::kZero);
  capacity_ = entries_for(slots_.size());
  shift_ = 64 - lowest_bit(slots_.size());
  for (const uint64_t slot : old) {
    if (slot == 0) continue;
    uint64_t at = slot >> shift_;
    while (slots_[at] != 0) at = (at + 1) & (slots_.size() - 1);
    slots_[at] = slot;
  }
}

void NodeTable::grow_records(uint64_t words) {
  if (words > kWordLimit) throw OutOfBudget{};
  records_.grow(memory_, words);
}

bool NodeTable::less(uint64_t slot_a, uint64_t slot_b) {
  Record a = record(static_cast<uint32_t>(slot_a)), b = record(static_cast<uint32_t>(slot_b));
  return compare_nodes(a.hash(), a.mask(), a.children(), b.hash(), b.mask(), b.children()) < 0;
}

std::span<const uint64_t> NodeTable::sort_slots(bool hashes_changed) {
  const auto tag = [](uint64_t slot) { return static_cast<uint32_t>(slot >> 32); };
  const std::span<uint64_t> slots = compact_slots(
      std::span(slots_.begin(), slots_.end()), [](uint64_t slot) { return slot != 0; }, tag);
  const auto is_less = [this](uint64_t a, uint64_t b) { return less(a, b); };
  if (hashes_changed)
    std::sort(slots.begin(), slots.end(), is_less);
  else
    sort_nearly_sorted(slots, tag, is_less);
  return slots;
}

}  // namespace voxdag
