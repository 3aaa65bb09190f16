// The unique nodes of one level of one subvolume, found by their hashes (hash-consing).
//
//   slots     [tag | id]  [tag | id] ...           8 bytes each; tag: upper half of the node's hash
//   records   hash (2 words), child mask, children        32-bit words; id: index of first word
//
// The number of a node's slot is the top bits of its hash. If that slot is taken, the node gets the
// next free slot (linear probing). So the slots are almost in the order of the hashes. The table
// therefore grows in one sequential pass over the slots, and sort_slots(), which makes the level
// array, only has to sort a nearly sorted array. Records keep their positions, in the order in
// which they were added, so neighbors in space are neighbors in memory. Not thread-safe. Throws
// OutOfBudget if the budget is too small, or if the records need more than 2^32 words.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/host_device.h"
#include "core/base/popcount8.h"
#include "core/dag/consing/pooled_memory.h"

namespace voxdag {

// Masks for comparing lists of up to eight children without branches. In of[count], the first
// `count` words have all bits set, and the other words are 0.
struct FirstWords {
  alignas(32) uint32_t of[9][8] = {};
  constexpr FirstWords() {
    for (int count = 0; count <= 8; ++count)
      for (int i = 0; i < count; ++i) of[count][i] = UINT32_MAX;
  }
};
inline constexpr FirstWords kFirstWords;

class NodeTable {
 public:
  // A reference to a record. Once the record's level is emitted, the record's position in the level
  // array replaces the low half of its hash.
  struct Record {
    static constexpr uint32_t kWords = 3;  // words before the children

    uint32_t* words;
    uint64_t hash() const { return words[0] | uint64_t{words[1]} << 32; }
    void set_hash(uint64_t hash) {
      words[0] = static_cast<uint32_t>(hash);
      words[1] = static_cast<uint32_t>(hash >> 32);
    }
    // The record's position in the level array.
    uint32_t place() const { return words[0]; }
    void set_place(uint32_t index) { words[0] = index; }
    uint32_t mask() const { return words[2]; }
    uint32_t* children() { return words + kWords; }
    int child_count() const { return popcount8(mask()); }
  };

  explicit NodeTable(PooledMemory& memory) : memory_(memory) {}

  uint64_t size() const { return count_; }
  uint64_t total_children() const { return used_ - count_ * Record::kWords; }
  Record record(uint32_t id) { return {&records_[id]}; }

  // Makes room for `more` nodes beyond size(). Call it before find_or_add() and the prefetch
  // functions, which do not grow the table. The room is for eight children per node, so that eight
  // words of children can be read from any record, even if its node has fewer children.
  void reserve(uint64_t more) {
    if (count_ + more > capacity_) grow_slots(count_ + more);
    const uint64_t words = kFirstId + used_ + more * (Record::kWords + 8);
    if (words > records_.size()) grow_records(words);
  }

  VOXDAG_PREFETCH void prefetch_slot(uint64_t hash) const {
    __builtin_prefetch(&slots_[hash >> shift_]);
  }
  // Prefetches the record that find_or_add() will most likely compare with the node.
  VOXDAG_PREFETCH void prefetch_record(uint64_t hash) const {
    __builtin_prefetch(&records_[static_cast<uint32_t>(slots_[hash >> shift_])]);
  }

  // Returns the id of the node with this hash, mask (not 0) and popcount(mask) children; adds the
  // node if it is new. Eight elements of `children` must be readable, even if the node has fewer.
  uint32_t find_or_add(uint64_t hash, uint32_t mask, const uint32_t* children, int child_count) {
    uint64_t at = hash >> shift_;
    while (const uint64_t slot = slots_[at]) {
      const uint32_t id = static_cast<uint32_t>(slot);
      if (slot >> 32 == hash >> 32 && is_node(id, mask, children, child_count)) return id;
      at = (at + 1) & (slots_.size() - 1);
    }
    return add(at, hash, mask, children, child_count);
  }

  // Calls visit(Record) for every node, in the order in which the nodes were added.
  template <class Visit>
  void for_each_record(Visit visit) {
    for (uint64_t at = kFirstId; at < used_ + kFirstId;) {
      Record found = record(static_cast<uint32_t>(at));
      visit(found);
      at += Record::kWords + found.child_count();
    }
  }

  // Returns all used slots, sorted by (hash, mask, children) of their records. The lower half of a
  // slot is the id of its record. `hashes_changed`: true if records got new hashes after they were
  // added. After this call, the table cannot be searched.
  std::span<const uint64_t> sort_slots(bool hashes_changed);

 private:
  static constexpr uint64_t kFirstId = 1;  // not 0, because a used slot must not be 0

  bool is_node(uint32_t id, uint32_t mask, const uint32_t* children, int child_count) const {
    const uint32_t* words = &records_[id + 2];
    // Compares eight children without branches. The branches of a loop over the node's children
    // would often be mispredicted.
    const uint32_t(&compared)[8] = kFirstWords.of[child_count];
    uint32_t differ = words[0] ^ mask;
    for (int i = 0; i < 8; ++i) differ |= (words[1 + i] ^ children[i]) & compared[i];
    return differ == 0;
  }
  uint32_t add(uint64_t at, uint64_t hash, uint32_t mask, const uint32_t* children,
               int child_count);
  void grow_slots(uint64_t nodes);
  void grow_records(uint64_t words);
  bool less(uint64_t slot_a, uint64_t slot_b);

  PooledMemory& memory_;
  PooledArray<uint64_t> slots_;  // 0: free
  PooledArray<uint32_t> records_;
  uint64_t capacity_ = 0;
  int shift_ = 64;  // slot of a hash = hash >> shift_
  uint64_t count_ = 0;
  uint64_t used_ = 0;  // number of words that the records occupy; they begin at word kFirstId
};

}  // namespace voxdag
