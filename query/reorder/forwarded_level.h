// A copy of a level in memory that stores the new offsets of its nodes. A node is placed when it
// gets its new offset. The new offset then overwrites the first two words of the node:
//
//     node, not placed:  its words; the first word is the child mask, 1 to 255
//     node, placed:      [0x100 | bits 32 to 47 of the new offset << 16] [low 32 bits]
//     brick, placed:     [high 32 bits] [low 32 bits], and its bit in placed_bricks_ is 1
//
// So a lookup needs no second table for nodes, and reads memory at only one place.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/base/popcount8.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

class ForwardedLevel {
 public:
  // Returns the memory that a ForwardedLevel of this level needs.
  static uint64_t bytes_of(const voxdag_reader::Level& level) {
    return sizeof(uint32_t) * level.word_count + sizeof(uint64_t) * (level.word_count / 128 + 1);
  }

  ForwardedLevel(DagInput& input, uint32_t level, MemoryBudget& budget)
      : input_(input),
        level_(level),
        is_brick_level_(level == input.file().brick_level()),
        is_wide_(!is_brick_level_ && input.level(level + 1).pointer_bits == 64),
        words_(budget, input.level(level).word_count, "nodes of a level"),
        placed_bricks_(budget, is_brick_level_ ? words_.size() / 128 + 1 : 0, "nodes of a level") {
    for (uint64_t first = 0; first < words_.size(); first += kChunkWords)
      std::ranges::copy(
          input.words(level, first, std::min<uint64_t>(kChunkWords, words_.size() - first)),
          words_.data() + first);
  }

  VOXDAG_PREFETCH void prefetch(uint64_t offset) const {
    if (offset < words_.size()) __builtin_prefetch(words_.data() + offset);
  }
  // Returns the new offset of the node or brick that begins at word `offset` of the input file. If
  // it is not placed yet, calls place(words), and stores the new offset that place() returns. New
  // offsets must be less than 2^48; levels have at most 2^40 words.
  template <class Place>
  uint64_t find(uint64_t offset, const Place& place) {
    if (words_.size() < 2 || offset > words_.size() - 2) no_node(offset);
    uint32_t* const node = words_.data() + offset;
    if (is_brick_level_) return find_brick(offset, node, place);
    if ((node[0] & kLowBits) == kPlaced)
      return static_cast<uint64_t>(node[0] >> 16) << 32 | node[1];
    if (node[0] == 0 || node[0] > 255) no_node(offset);
    const uint64_t size = 1 + (uint64_t{kPopcount8[node[0]]} << is_wide_);
    if (size > words_.size() - offset) no_node(offset);
    const uint64_t placed = place(std::span<const uint32_t>(node, size));
    node[0] = kPlaced | static_cast<uint32_t>(placed >> 32) << 16;
    node[1] = static_cast<uint32_t>(placed);
    return placed;
  }

 private:
  static constexpr uint64_t kChunkWords = uint64_t{1} << 16;
  static constexpr uint32_t kPlaced = 0x100, kLowBits = 0xffff;

  template <class Place>
  uint64_t find_brick(uint64_t offset, uint32_t* brick, const Place& place) {
    if (offset % 2 != 0) no_node(offset);
    uint64_t& bits = placed_bricks_[offset / 128];
    const uint64_t bit = uint64_t{1} << offset / 2 % 64;
    if (bits & bit) return static_cast<uint64_t>(brick[0]) << 32 | brick[1];
    const uint64_t placed = place(std::span<const uint32_t>(brick, 2));
    brick[0] = static_cast<uint32_t>(placed >> 32);
    brick[1] = static_cast<uint32_t>(placed);
    bits |= bit;
    return placed;
  }
  [[noreturn]] void no_node(uint64_t offset) const {
    input_.corrupt(level_, offset, "no node begins here, but a pointer refers to it");
  }

  const DagInput& input_;
  const uint32_t level_;
  const bool is_brick_level_;
  const bool is_wide_;
  PageBuffer<uint32_t> words_;
  PageBuffer<uint64_t> placed_bricks_;  // one bit for each brick: 1 if it is placed
};

}  // namespace voxdag::query
