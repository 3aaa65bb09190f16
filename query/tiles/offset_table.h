// Gives equal word offsets of a level the same number: 0, 1, 2, ... in order of first use.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace voxdag::query {

class OffsetTable {
 public:
  // The number of the offset, a new one if it was not added before.
  uint32_t add(uint64_t offset) {
    if (offsets_.size() * 2 >= slots_.size()) grow();
    uint32_t& slot = find(offset);
    if (slot == 0) {
      offsets_.push_back(offset);
      slot = static_cast<uint32_t>(offsets_.size());
    }
    return slot - 1;
  }
  // In the order of their numbers.
  const std::vector<uint64_t>& offsets() const { return offsets_; }

 private:
  // The slot that has the offset, or the free one where it belongs.
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

  std::vector<uint32_t> slots_;  // a power of two of numbers plus 1; 0 is free
  std::vector<uint64_t> offsets_;
};

}  // namespace voxdag::query
