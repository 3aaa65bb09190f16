// A value for each node of a level, looked up by the node's word offset. If the values do not fit
// in their share of the memory, they are in a scratch file, and lookups take three sequential
// passes instead of random reads:
//
//   1. NodeLookups::announce() receives the offsets of all lookups, in their order. It adds each
//      offset to the bucket of its window, a range of offsets whose values fit in memory.
//   2. resolve() loads one window after the other and writes the values of the window's bucket.
//   3. next() receives the same offsets in the same order and reads the values from the buckets.
//
// Every node has at least two words, so offset / 2 is a different number for every node. A window
// is an array by these numbers. In memory, the values are in an array by the order of their nodes,
// because it is smaller; a bit for each word of the level tells where nodes begin.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/base/host_device.h"
#include "core/format/global/voxdag_reader.h"
#include "query/combine/spill.h"

namespace voxdag::query {

// A number and the lowest bit of the offset of its node; 0 if no node begins there. A damaged
// file's pointer to the middle of a node has another tag, or none.
constexpr uint64_t make_tag(uint64_t number, uint64_t offset) {
  return number << 2 | (offset & 1) << 1 | 1;
}
constexpr bool is_tag_of(uint64_t tag, uint64_t offset) {
  return (tag & 3) == ((offset & 1) << 1 | 1);
}
constexpr uint64_t number_of_tag(uint64_t tag) { return tag >> 2; }

template <class T>
class NodeValues {
 public:
  // The values are in memory if they take at most `resident_bytes`.
  NodeValues(const SpillSpace& space, const voxdag_reader::Level& level, uint64_t resident_bytes)
      : level_words_(level.word_count) {
    const uint64_t blocks = level_words_ / kBlockWords + 1;
    if (level.node_count <= resident_bytes / sizeof(T) &&
        blocks <= (resident_bytes - level.node_count * sizeof(T)) / sizeof(Block)) {
      blocks_ = PageBuffer<Block>(space.budget, blocks, "values of a level");
      values_ = PageBuffer<T>(space.budget, level.node_count, "values of a level");
    } else {
      list_.emplace(space);
    }
  }

  bool is_resident() const { return !list_; }
  uint64_t level_words() const { return level_words_; }
  // Offsets must increase.
  void add(uint64_t offset, const T& value) {
    if (list_) return list_->add({offset, value});
    Block& block = blocks_[offset / kBlockWords];
    if (block.begins == 0) block.before = count_;
    block.begins |= uint64_t{1} << offset % kBlockWords;
    values_[count_++] = value;
  }
  void finish() {
    if (list_) list_->finish();
  }
  // Require is_resident(). Without a value for the offset, find() returns null and at() a zero
  // value.
  const T* find(uint64_t offset) const {
    if (offset >= level_words_) return nullptr;
    const Block& block = blocks_[offset / kBlockWords];
    const uint64_t bit = uint64_t{1} << offset % kBlockWords;
    if (!(block.begins & bit)) return nullptr;
    return &values_[block.before + static_cast<uint64_t>(popcount64(block.begins & (bit - 1)))];
  }
  T at(uint64_t offset) const {
    const T* const value = find(offset);
    return value ? *value : T{};
  }

 private:
  template <class>
  friend class NodeLookups;
  struct Entry {
    uint64_t offset;
    T value;
  };
  static constexpr uint64_t kBlockWords = 64;
  // A block of words of the level.
  struct Block {
    uint64_t begins;  // a bit for each word, set if a node with a value begins there
    uint64_t before;  // values of the blocks before
  };

  const uint64_t level_words_;
  PageBuffer<Block> blocks_;
  PageBuffer<T> values_;
  uint64_t count_ = 0;
  std::optional<SpillList<Entry>> list_;
};

template <class T>
class NodeLookups {
 public:
  // Windows, and the buffers of the buckets, take about `bytes` each.
  NodeLookups(const NodeValues<T>& values, const SpillSpace& space, uint64_t bytes)
      : values_(values), space_(space), bytes_(bytes) {
    if (values.is_resident()) return;
    window_slots_ = std::clamp<uint64_t>(bytes / sizeof(T), 16, UINT32_MAX);
    windows_ = values.level_words() / 2 / window_slots_ + 1;
    requests_ = std::make_unique<SpillBuckets<uint32_t>>(space, windows_, bytes);
  }

  // True if announce() and resolve() must be called before next().
  bool needs_announcement() const { return requests_ != nullptr; }
  void announce(uint64_t offset) {
    if (offset >= values_.level_words()) return;
    const uint64_t slot = offset / 2;
    requests_->add(slot / window_slots_, static_cast<uint32_t>(slot % window_slots_));
  }
  void resolve() {
    requests_->finish();
    answers_ = std::make_unique<SpillBuckets<T>>(space_, windows_, bytes_);
    SpillReader reader(*values_.list_);
    for (uint64_t w = 0; w < windows_; ++w) {
      PageBuffer<T> window(space_.budget, window_slots_, "values of a level");
      for (; !reader.at_end() && reader.front().offset / 2 / window_slots_ == w; reader.pop())
        window[reader.front().offset / 2 % window_slots_] = reader.front().value;
      for (uint64_t i = requests_->size(w); i > 0; --i)
        answers_->add(w, window[requests_->next(w)]);
    }
    answers_->finish();
    requests_.reset();
  }
  // Returns a zero value, or a value with another tag, if no node begins at the offset.
  T next(uint64_t offset) {
    if (!answers_) return values_.at(offset);
    return offset < values_.level_words() ? answers_->next(offset / 2 / window_slots_) : T{};
  }

 private:
  const NodeValues<T>& values_;
  const SpillSpace& space_;
  const uint64_t bytes_;
  uint64_t window_slots_ = 0;
  uint64_t windows_ = 0;
  std::unique_ptr<SpillBuckets<uint32_t>> requests_;
  std::unique_ptr<SpillBuckets<T>> answers_;
};

}  // namespace voxdag::query
