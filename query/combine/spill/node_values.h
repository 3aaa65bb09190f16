// A value for each node of a level, looked up by the node's word offset. If the values do not fit
// in their share of the memory, they are in a scratch file, and lookups take three sequential
// passes instead of random reads:
//
//   1. NodeLookups::announce() receives the offsets of all lookups, in their order. It adds each
//      offset to the bucket of its window, a range of offsets whose values fit in memory.
//   2. resolve() loads one window after the other and writes the values of the window's bucket.
//   3. next() receives the same offsets in the same order and reads the values from the buckets.
//
// Values in memory are in an array in the order of their nodes. To find a node's index, the words
// of the level are divided into blocks. Each block stores a bit for each of its words, which tells
// whether a node with a value begins there, and the number of such nodes before the block.
//
// In a window, the index of a value is offset / 2 instead. Every node has at least two words, so
// this number is different for every node.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "core/base/host_device.h"
#include "core/base/popcount8.h"
#include "core/format/global/voxdag_reader.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

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
    // In a damaged file, node_count can be any number. LevelCursor refuses such a level at its end.
    const uint64_t blocks = level_words_ / kBlockWords + 1,
                   values = std::min(level.node_count, level_words_ / 2 + 1);
    if (values * sizeof(T) + blocks * sizeof(uint64_t) <= resident_bytes) {
      blocks_ = PageBuffer<uint64_t>(space.budget, blocks, "values of a level");
      values_ = PageBuffer<T>(space.budget, values, "values of a level");
    } else {
      list_.emplace(space);
    }
  }

  bool is_resident() const { return !list_; }
  uint64_t level_words() const { return level_words_; }
  // Offsets must increase.
  void add(uint64_t offset, const T& value) {
    if (list_) return list_->add({offset, value});
    if (count_ == values_.size()) return;  // a damaged file
    uint64_t& block = blocks_[offset / kBlockWords];
    if (block == 0) block = count_ << kBlockWords;
    block |= uint64_t{1} << offset % kBlockWords;
    values_[count_++] = value;
  }
  void finish() {
    if (list_) list_->finish();
  }

  // The next four functions require is_resident(). They are the steps of a lookup in memory, so
  // that NodeLookups can load cache lines early: locate() returns the index of the value at a word
  // offset, or kNone. at() returns the value at an index. prefetch() loads the cache line that
  // locate() reads, and prefetch_value() the one that at() reads.
  static constexpr bool kIsLocated = true;
  VOXDAG_PREFETCH void prefetch(uint64_t offset) const {
    if (offset < level_words_) __builtin_prefetch(&blocks_[offset / kBlockWords]);
  }
  uint64_t locate(uint64_t offset) const {
    if (offset >= level_words_) return kNone;
    const uint64_t block = blocks_[offset / kBlockWords];
    const uint64_t bit = offset % kBlockWords;
    const uint32_t bits = static_cast<uint32_t>(block) & ((2u << bit) - 1);
    if (bits >> bit == 0) return kNone;
    return (block >> kBlockWords) + static_cast<uint64_t>(popcount8(bits) + popcount8(bits >> 8)) -
           1;
  }
  VOXDAG_PREFETCH void prefetch_value(uint64_t index) const {
    if (index != kNone) __builtin_prefetch(&values_[index]);
  }
  FoundValue<T> at(uint64_t index) const {
    if (index == kNone) return {};
    return {values_[index], 1};
  }
  // Returns the values, in the order of their nodes. The object must not be used again. Requires
  // is_resident().
  PageBuffer<T> take_values() { return std::move(values_); }

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
  static constexpr uint64_t kBlockWords = 16;
  static constexpr uint64_t kNone = ~uint64_t{0};

  const uint64_t level_words_;
  // The low 16 bits of a block have a bit for each word. The other bits are the number of nodes
  // with a value before the block; they are valid if one of the low bits is set.
  PageBuffer<uint64_t> blocks_;
  PageBuffer<T> values_;
  uint64_t count_ = 0;  // values in values_
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
  // Prepares the lookups of the children of the cursor's node and of nodes after it. Call it before
  // the calls of next() for the node, for all nodes whose children are looked up or for none.
  void visit(const LevelCursor& cursor) {
    if (!values_.is_resident() || cursor.is_wide()) return;
    const std::span<const uint32_t> words = cursor.verified_words();
    // Some of the words are masks. The results for them are not used.
    const uint64_t prefetch_end = std::min(cursor.offset() + kPrefetchWords, words.size());
    for (uint64_t i = std::max(prefetched_, cursor.offset()); i < prefetch_end; ++i)
      values_.prefetch(words[i]);
    prefetched_ = prefetch_end;
    if constexpr (Values::kIsLocated) locate(cursor.offset(), words);
  }
  // Returns the value at `offset`, the word offset of the next child.
  auto next(uint64_t offset) {
    if (is_visiting_) return values_.at(indices_[next_word_++ % kLocateWords]);
    if (!answers_) return values_.at(values_.locate(offset));
    if (offset >= values_.level_words()) return Values::nothing();
    return Values::found(offset, answers_->next(offset / 2 / window_slots_));
  }

 private:
  void locate(uint64_t node, std::span<const uint32_t> words) {
    const uint64_t end = std::min(node + kLocateWords, words.size());
    for (uint64_t i = std::max(located_, node); i < end; ++i) {
      const uint64_t index = values_.locate(words[i]);
      values_.prefetch_value(index);
      indices_[i % kLocateWords] = index;
    }
    located_ = end;
    next_word_ = node + 1;
    is_visiting_ = true;
  }

  const Values& values_;
  const SpillSpace& space_;
  const uint64_t bytes_;
  uint64_t window_slots_ = 0;
  uint64_t windows_ = 0;
  std::unique_ptr<SpillBuckets<uint32_t>> requests_;
  std::unique_ptr<SpillBuckets<Slot>> answers_;

  // The state of visit(). It works on words that are up to kPrefetchWords after the beginning of
  // the node.
  static constexpr uint64_t kPrefetchWords = 96, kLocateWords = 64;
  bool is_visiting_ = false;
  uint64_t prefetched_ = 0;         // the words before it are prefetched
  uint64_t located_ = 0;            // the words before it are located
  uint64_t next_word_ = 0;          // the word of the next child
  uint64_t indices_[kLocateWords];  // what locate() returned for word i is at i % kLocateWords
};

}  // namespace voxdag::query
