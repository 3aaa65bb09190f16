// A value for each node of a level, looked up by the node's word offset. If the values do not fit
// in their share of the memory, they are in a scratch file, and lookups take three sequential
// passes instead of random reads:
//
//   1. NodeLookups::announce() receives the offsets of all lookups, in their order. It adds each
//      offset to the bucket of its window, a range of offsets whose values fit in memory.
//   2. resolve() loads one window after the other and writes the values of the window's bucket.
//   3. next() receives the same offsets in the same order and reads the values from the buckets.
//
// Every node has at least two words, so offset / 2 is a different number for every node. These
// numbers are the indices of the arrays that store the values in memory and the windows. So a
// lookup is one read, whose address is known early enough to prefetch it. If the values are in
// memory, a bit for each word of the level tells whether a node with a value begins there.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/base/host_device.h"
#include "core/format/global/voxdag_reader.h"
#include "query/combine/spill/spill.h"

namespace voxdag::query {

// The result of a lookup. `begins` is 0 if no node with a value begins at the offset.
template <class T>
struct FoundValue {
  T value;
  uint64_t begins;
};

template <class T>
class NodeValues {
  struct Entry {
    uint64_t offset;
    T value;
  };

 public:
  // Keeps the values in memory if they take at most `resident_bytes`, otherwise in a scratch file.
  NodeValues(const SpillSpace& space, const voxdag_reader::Level& level, uint64_t resident_bytes)
      : level_words_(level.word_count) {
    const uint64_t slots = level_words_ / 2 + 1, blocks = level_words_ / 64 + 1;
    if (slots * sizeof(T) + blocks * sizeof(uint64_t) <= resident_bytes) {
      begins_ = PageBuffer<uint64_t>(space.budget, blocks, "values of a level");
      values_ = PageBuffer<T>(space.budget, slots, "values of a level");
    } else {
      list_.emplace(space);
    }
  }

  bool is_resident() const { return !list_; }
  uint64_t level_words() const { return level_words_; }
  // Offsets must increase.
  void add(uint64_t offset, const T& value) {
    if (list_) return list_->add({offset, value});
    begins_[offset / 64] |= uint64_t{1} << offset % 64;
    values_[offset / 2] = value;
  }
  void finish() {
    if (list_) list_->finish();
  }
  // at() returns the value at a word offset, and prefetch() loads its cache line. Both require
  // is_resident().
  FoundValue<T> at(uint64_t offset) const {
    if (offset >= level_words_) return {};
    return {values_[offset / 2], begins_[offset / 64] >> offset % 64 & 1};
  }
  VOXDAG_PREFETCH void prefetch(uint64_t offset) const {
    if (offset >= level_words_) return;
    __builtin_prefetch(&values_[offset / 2]);
    __builtin_prefetch(&begins_[offset / 64]);
  }

  // For NodeLookups, which reads the values of a window as slots. A slot has the value for two
  // consecutive words. A node can begin at only one of them: `begins` is 1 if a node with a value
  // begins at the first word, 2 if it begins at the second, and 0 if there is no such node.
  using Slot = FoundValue<T>;
  class WindowReader {
   public:
    explicit WindowReader(const NodeValues& values) : reader_(*values.list_) {}
    // Fills the slots of a window that begins at slot `first_slot`. Windows must be read in
    // increasing order.
    void read(uint64_t first_slot, PageBuffer<Slot>& window) {
      for (; !reader_.at_end() && reader_.front().offset / 2 - first_slot < window.size();
           reader_.pop())
        window[reader_.front().offset / 2 - first_slot] = {reader_.front().value,
                                                           1 + (reader_.front().offset & 1)};
    }

   private:
    SpillReader<Entry> reader_;
  };
  // Returns the result of a lookup of `offset`. `slot` is the slot that contains this word.
  static FoundValue<T> found(uint64_t offset, const Slot& slot) {
    return slot.begins == 1 + (offset & 1) ? slot : FoundValue<T>{};
  }
  static FoundValue<T> nothing() { return {}; }

 private:
  const uint64_t level_words_;
  PageBuffer<uint64_t> begins_;
  PageBuffer<T> values_;
  std::optional<SpillList<Entry>> list_;
};

// Looks up many values in the three passes that the top of this file describes. `Values` is a class
// like NodeValues.
template <class Values>
class NodeLookups {
 public:
  using Slot = typename Values::Slot;
  // `bytes` is the approximate memory of a window, and also of the buffers of all buckets together.
  NodeLookups(const Values& values, const SpillSpace& space, uint64_t bytes)
      : values_(values), space_(space), bytes_(bytes) {
    if (values.is_resident()) return;
    window_slots_ = std::clamp<uint64_t>(bytes / sizeof(Slot), 16, UINT32_MAX);
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
    answers_ = std::make_unique<SpillBuckets<Slot>>(space_, windows_, bytes_);
    typename Values::WindowReader reader(values_);
    for (uint64_t w = 0; w < windows_; ++w) {
      PageBuffer<Slot> window(space_.budget, window_slots_, "values of a level");
      reader.read(w * window_slots_, window);
      for (uint64_t i = requests_->size(w); i > 0; --i)
        answers_->add(w, window[requests_->next(w)]);
    }
    answers_->finish();
    requests_.reset();
  }
  auto next(uint64_t offset) {
    if (!answers_) return values_.at(offset);
    if (offset >= values_.level_words()) return Values::nothing();
    return Values::found(offset, answers_->next(offset / 2 / window_slots_));
  }
  // Interprets each word as a word offset, and prefetches the value at this offset. `words` are
  // words that LevelCursor::words_ahead() returns; most of them are pointers to nodes.
  VOXDAG_PREFETCH void prefetch(std::span<const uint32_t> words) const {
    if (!values_.is_resident()) return;
    for (const uint32_t word : words) values_.prefetch(word);
  }

 private:
  const Values& values_;
  const SpillSpace& space_;
  const uint64_t bytes_;
  uint64_t window_slots_ = 0;
  uint64_t windows_ = 0;
  std::unique_ptr<SpillBuckets<uint32_t>> requests_;
  std::unique_ptr<SpillBuckets<Slot>> answers_;
};

}  // namespace voxdag::query
