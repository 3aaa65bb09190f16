// Assigns the numbers 0, 1, 2, ... to the word offsets of a level, in the order in which they are
// added. Equal offsets get the same number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace voxdag::query {

class OffsetTable {
 public:
  // Returns the number of the offset. An offset that is new gets the next number.
  uint32_t add(uint64_t offset) {
    if (offsets_.size() * 2 >= slots_.size()) grow();
    uint32_t& slot = find(offset);
    if (slot == 0) {
      offsets_.push_back(offset);
      slot = static_cast<uint32_t>(offsets_.size());
    }
    return slot - 1;
  }
  // Returns all offsets, in the order of their numbers.
  const std::vector<uint64_t>& offsets() const { return offsets_; }

 private:
  // Returns the slot of the offset. If the offset is new, returns the free slot that it will use.
  uint32_t& find(uint64_t offset) {
    size_t at = static_cast<size_t>(offset * 0x9e3779b97f4a7c15ull >> 32) & (slots_.size() - 1);
    while (slots_[at] != 0 && offsets_[slots_[at] - 1] != offset)
      at = (at + 1) & (slots_.size() - 1);
    return slots_[at];
  }
  void grow() {
    slots_.assign(slots_.empty() ? 64 : slots_.size() * 2, 0);
    for (size_t i = 0; i < offsets_.size(); ++i) find(offsets_[i]) = static_cast<uint32_t>(i + 1);
  }

  // A hash table. A slot holds number + 1, or 0 if it is free. The size is a power of two.
  std::vector<uint32_t> slots_;
  std::vector<uint64_t> offsets_;
};

}  // namespace voxdag::query
