// The nodes of one level of the file that are below the root of a part and have selected cells. A
// node that the region does not cut (part_builder.h) is added once, for any number of parents. A
// node that the region cuts is added once per position. Nodes are numbered in the order in which
// they are added.
//
//   slots     [tag | number + 1] ...    open addressing by offset, for nodes that are not cut
//
// A slot has 64 bits; it is 0 if it is free. The tag is the lower half of the product of the offset
// and an odd number, so it determines the lower half of the offset. In a level that is not wide,
// the tag alone identifies the offset. In a wide level, the complete offsets are also compared.
//
// Not thread-safe. Throws OutOfBudget when a node does not fit in the budget, or when there would
// be more than 2^32 - 1 nodes.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/host_device.h"
#include "core/dag/consing/pooled_memory.h"
#include "query/extract/node_reader.h"

namespace voxdag::query {

class PartLevel {
 public:
  using Position = std::array<uint32_t, 3>;  // in cubes of the level

  // `wide`: the level of the file has more than 2^32 words.
  PartLevel(PooledMemory& memory, bool wide) : memory_(&memory), wide_(wide) {}

  uint64_t size() const { return count_; }
  bool is_cut(uint64_t index) const { return entries_[index].place != kWhole; }
  Position position(uint64_t index) const {
    const uint64_t place = entries_[index].place;
    return {static_cast<uint32_t>(place & kAxisMask),
            static_cast<uint32_t>(place >> kAxisBits & kAxisMask),
            static_cast<uint32_t>(place >> 2 * kAxisBits)};
  }

  // Makes room in the hash table for at least `count` nodes.
  void reserve(uint64_t count) {
    if (2 * count >= slots_size_) grow_slots(2 * count + 1);
  }
  VOXDAG_PREFETCH void prefetch(uint64_t offset) const {
    __builtin_prefetch(&slots_[offset * kMultiplier >> shift_]);
  }
  // Returns the number of the node at `offset`, which must not be cut by the region. Adds the node
  // if it is new.
  uint32_t find_or_add(uint64_t offset) {
    if (2 * count_ >= slots_size_) grow_slots(2 * count_ + 1);
    const uint64_t hash = offset * kMultiplier;
    uint64_t at = hash >> shift_;
    for (; slots_[at] != 0; at = (at + 1) & (slots_size_ - 1)) {
      const uint64_t index = (slots_[at] & UINT32_MAX) - 1;
      if (slots_[at] >> 32 == (hash & UINT32_MAX) && (!wide_ || entries_[index].offset == offset))
        return static_cast<uint32_t>(index);
    }
    const uint32_t index = add({offset, kWhole});
    slots_[at] = hash << 32 | (index + 1);
    return index;
  }
  // Adds a node that the region cuts at this position, and returns its number.
  uint32_t add_cut(uint64_t offset, const Position& position) {
    return add({offset, position[0] | uint64_t{position[1]} << kAxisBits |
                            uint64_t{position[2]} << 2 * kAxisBits});
  }

  // All nodes, sorted by their offsets. A node's `index` is its number. No node may be added after
  // the call of sort(), which frees the hash table.
  struct Sorted {
    PooledArray<WantedNode> nodes;
    uint64_t count = 0;
    std::span<const WantedNode> span() const { return {nodes.data(), count}; }
  };
  Sorted sort();
  // Frees the memory for offsets and positions. is_cut() and position() must not be called
  // afterwards.
  void release_entries() { entries_ = {}; }

 private:
  static constexpr uint64_t kWhole = ~uint64_t{0};
  static constexpr int kAxisBits = 20;
  static constexpr uint64_t kAxisMask = (uint64_t{1} << kAxisBits) - 1;
  static constexpr uint64_t kMultiplier = 0x9e3779b97f4a7c15ull;

  struct Entry {
    uint64_t offset;
    uint64_t place;  // the position, or kWhole
  };

  uint32_t add(const Entry& entry) {
    if (count_ == UINT32_MAX) throw OutOfBudget{};
    if (count_ == entries_.size()) entries_.grow(*memory_, count_ + kFirstEntries);
    entries_[count_] = entry;
    return static_cast<uint32_t>(count_++);
  }
  void grow_slots(uint64_t slots_needed);

  static constexpr uint64_t kFirstEntries = 256;
  static constexpr uint64_t kFirstSlots = 512;

  PooledMemory* memory_;
  bool wide_;
  PooledArray<Entry> entries_;
  PooledArray<uint64_t> slots_;
  uint64_t slots_size_ = 0;
  int shift_ = 64;
  uint64_t count_ = 0;
};

}  // namespace voxdag::query
