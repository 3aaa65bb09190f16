// Random access to the values of consecutive elements, such as the colors of vertices, within a
// fixed amount of memory. Blocks of elements are cached; block b can only be in slot b modulo the
// number of slots. Not thread-safe.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"

namespace voxdag {

template <class Value>
class BlockCache {
 public:
  // The caches of all readers together take at most 1/kShareOfFree of the free budget.
  static constexpr uint64_t kShareOfFree = 8;

  // Makes a cache for `count` elements, one of `readers` caches of equal size. It takes at most
  // 1/(kShareOfFree * readers) of the free budget, but at least one block.
  BlockCache(MemoryBudget& budget, uint64_t count, unsigned readers, std::string_view what)
      : count_(count) {
    constexpr uint64_t kBlockBytes = kBlockSize * sizeof(Value);
    const uint64_t wanted = std::bit_ceil((count + kBlockSize - 1) / kBlockSize);
    const uint64_t fits_budget = budget.available() / kShareOfFree / readers / kBlockBytes;
    const uint64_t slots = std::clamp<uint64_t>(std::bit_floor(fits_budget), 1, wanted);
    values_ = PageBuffer<Value>(budget, static_cast<size_t>(slots * kBlockSize), what);
    block_in_slot_.assign(static_cast<size_t>(slots), kNoBlock);
    slot_mask_ = static_cast<size_t>(slots) - 1;
  }

  // Returns the value of `element`, which must be below `count`. The reference is valid until the
  // next call. If the value is not cached, calls load(first, n, out), which writes the values of
  // elements [first, first + n).
  template <class Load>
  const Value& at(uint64_t element, const Load& load) {
    const uint64_t block = element / kBlockSize;
    const size_t slot = static_cast<size_t>(block) & slot_mask_;
    Value* const values = &values_[slot * kBlockSize];
    if (block_in_slot_[slot] != block) {
      block_in_slot_[slot] = kNoBlock;
      const uint64_t first = block * kBlockSize;
      load(first, static_cast<size_t>(std::min(kBlockSize, count_ - first)), values);
      block_in_slot_[slot] = block;
    }
    return values[element % kBlockSize];
  }

 private:
  static constexpr uint64_t kBlockSize = 1024;
  static constexpr uint64_t kNoBlock = ~uint64_t{0};

  uint64_t count_;
  PageBuffer<Value> values_;
  std::vector<uint64_t> block_in_slot_;
  size_t slot_mask_ = 0;
};

}  // namespace voxdag
