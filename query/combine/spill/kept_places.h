// For each kept node (pair_levels.h) of a level of an input file: its word offset in the new file.
//
// Kept nodes have the same order in both files, and most are moved together with the nodes around
// them. So instead of offsets, KeptPlaces stores *shifts* (new offset minus old offset): one for
// each block of 64 words whose nodes have the same shift, otherwise one for each two words of the
// block. If shifts for each two words of the level would not fit in their share of the memory, the
// offsets are in NodeValues, in a scratch file. NodeLookups (node_values.h) looks up offsets in
// both cases.
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/host_device.h"
#include "query/combine/spill/node_values.h"

namespace voxdag::query {

class KeptPlaces {
  using Offsets = NodeValues<uint64_t>;

 public:
  using Slot = Offsets::Slot;
  struct WindowReader : Offsets::WindowReader {
    explicit WindowReader(const KeptPlaces& places) : Offsets::WindowReader(*places.offsets_) {}
  };

  KeptPlaces(const SpillSpace& space, const voxdag_reader::Level& level, uint64_t resident_bytes)
      : level_words_(level.word_count), budget_(&space.budget) {
    const uint64_t blocks = level_words_ / kBlockWords + 1;
    if ((kBlockSlots + 1) * sizeof(int64_t) * blocks <= resident_bytes)
      shifts_ = PageBuffer<int64_t>(space.budget, blocks, "values of a level");
    else
      offsets_.emplace(space, level, 0);
  }

  bool is_resident() const { return !offsets_; }
  uint64_t level_words() const { return level_words_; }
  // Stores the new offset of the node at word `offset`. These words must increase.
  void add(uint64_t offset, uint64_t new_offset) {
    if (offsets_) return offsets_->add(offset, new_offset);
    const uint64_t block = offset / kBlockWords;
    const int64_t shift = static_cast<int64_t>(new_offset - offset);
    int64_t& of_block = shifts_[block];
    if (block != last_block_) {
      of_block = 2 * shift;
      last_block_ = block;
    } else if (of_block % 2 == 0 && of_block != 2 * shift) {
      of_block = 2 * divide_block(of_block / 2) + 1;
    }
    if (of_block % 2 != 0) slot_shifts_.data()[slot_of(of_block, offset)] = shift;
  }
  void finish() {
    if (offsets_) offsets_->finish();
  }

  // The steps of a lookup in memory, as in NodeValues. The index of an offset is the offset. at()
  // can return any value if no node begins at the offset. Require is_resident().
  static constexpr bool kIsLocated = false;
  VOXDAG_PREFETCH void prefetch(uint64_t offset) const {
    if (offset < level_words_) __builtin_prefetch(&shifts_[offset / kBlockWords]);
  }
  uint64_t locate(uint64_t offset) const { return offset; }
  FoundValue<uint64_t> at(uint64_t offset) const {
    if (offset >= level_words_) return {};
    int64_t shift = shifts_[offset / kBlockWords];
    shift = shift % 2 == 0 ? shift / 2 : slot_shifts_[slot_of(shift, offset)];
    return {offset + static_cast<uint64_t>(shift), 1};
  }

  static FoundValue<uint64_t> found(uint64_t offset, const Slot& slot) {
    return Offsets::found(offset, slot);
  }
  static FoundValue<uint64_t> nothing() { return Offsets::nothing(); }

 private:
  static constexpr uint64_t kBlockWords = 64, kBlockSlots = kBlockWords / 2;

  // Returns the index in slot_shifts_ of the shift of the node at `offset`, whose block is divided.
  static uint64_t slot_of(int64_t of_block, uint64_t offset) {
    return static_cast<uint64_t>(of_block / 2) * kBlockSlots + offset / 2 % kBlockSlots;
  }
  // Adds the slots of a block, all with the shift `shift`. Returns the number of the block in
  // slot_shifts_.
  int64_t divide_block(int64_t shift) {
    const uint64_t max = (level_words_ / kBlockWords + 1) * kBlockSlots;
    for (uint64_t i = 0; i < kBlockSlots; ++i) slot_shifts_.try_add(shift, max, *budget_);
    return static_cast<int64_t>(slot_shifts_.size() / kBlockSlots) - 1;
  }

  const uint64_t level_words_;
  MemoryBudget* budget_;
  // For each block: 2 * shift, or 2 * n + 1 if the shifts of its nodes are the n-th 32 shifts of
  // slot_shifts_, one for each two words.
  PageBuffer<int64_t> shifts_;
  GrowingItems<int64_t> slot_shifts_;
  uint64_t last_block_ = ~uint64_t{0};
  std::optional<Offsets> offsets_;
};

}  // namespace voxdag::query
