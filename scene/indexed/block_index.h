// Records the position (an Entry) of every n-th element of a file whose elements vary in size,
// within a fixed amount of memory. To find any other element, a reader starts at the last recorded
// element before it. n is 1024 at first. When the index is full, it drops every second entry and
// doubles n.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>

#include "core/base/memory_budget.h"
#include "scene/growing_charge.h"

namespace voxdag {

template <class Entry>
class BlockIndex {
 public:
  static constexpr uint64_t kFirstStride = 1024;

  // The index never has more than `max_entries`, an even number.
  BlockIndex(MemoryBudget& budget, size_t max_entries, const std::string& what)
      : max_entries_(max_entries), charge_(budget, what) {}

  // True if the caller must call add() for the element with this number. Elements come in order.
  bool wants(uint64_t element) const { return (element & (stride_ - 1)) == 0; }
  void add(const Entry& entry) {
    charge_.grow_to((entries_.size() + 1) * sizeof(Entry));
    entries_.push_back(entry);
    if (entries_.size() > max_entries_) thin_out();
  }
  // Returns the number of the first element of the block that contains this element. A block is the
  // elements from one recorded position to the next.
  uint64_t block_begin(uint64_t element) const { return element & ~(stride_ - 1); }
  // Returns the entry of the block that contains this element.
  const Entry& at(uint64_t element) const {
    return entries_[static_cast<size_t>(element / stride_)];
  }
  Entry& at(uint64_t element) { return entries_[static_cast<size_t>(element / stride_)]; }
  // Finds the last block whose entry has at most `value` in `member`, and returns the number of its
  // first element. `member` must not decrease from entry to entry.
  uint64_t find(uint64_t value, uint64_t Entry::*member) const {
    const auto after = std::ranges::upper_bound(entries_, value, {}, member);
    return static_cast<uint64_t>(after - entries_.begin() - 1) * stride_;
  }

 private:
  void thin_out() {
    size_t kept = 0;
    for (size_t i = 0; i < entries_.size(); i += 2) entries_[kept++] = entries_[i];
    entries_.resize(kept);
    stride_ *= 2;
  }

  const size_t max_entries_;
  GrowingCharge charge_;
  uint64_t stride_ = kFirstStride;
  std::deque<Entry> entries_;
};

}  // namespace voxdag
