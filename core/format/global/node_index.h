// Maps the word offset where a node of a level of the global file begins to its index in the level.
// Takes 1.5 bits per word. Immutable after construction.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag {

class NodeIndex {
 public:
  static constexpr uint64_t kNone = ~uint64_t{0};

  NodeIndex() = default;
  // Walks the words of the level. Throws Error{kCorrupt} beginning with `where` unless every child
  // mask is 1 to 255, the last node ends with the level, and there are as many nodes as the header
  // says.
  NodeIndex(const voxdag_reader::Level& level, bool bricks, MemoryBudget& budget,
            const std::string& where);

  // The index of the node that begins at `offset`; kNone if none does.
  uint64_t find(uint64_t offset) const {
    if (offset >= words_) return kNone;
    if (bricks_) return offset % 2 == 0 ? offset / 2 : kNone;
    const uint64_t bits = starts_[offset / 64], bit = uint64_t{1} << offset % 64;
    return bits & bit
               ? nodes_before_[offset / 64] + static_cast<uint64_t>(popcount64(bits & (bit - 1)))
               : kNone;
  }

 private:
  bool bricks_ = false;
  uint64_t words_ = 0;
  PageBuffer<uint64_t> starts_;        // one bit per word: a node begins here
  PageBuffer<uint32_t> nodes_before_;  // for each 64 words
};

}  // namespace voxdag
