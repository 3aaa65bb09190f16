// Maps the word offsets at which the nodes of a level of the global file begin to the indexes of
// the nodes.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>

#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/global/node_spans.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag {

// Maps the word offset at which a node begins to the node's index in its level. Takes 2 bits of
// memory per word of the level, and nothing for bricks. Immutable after construction.
class NodeIndex {
 public:
  static constexpr uint64_t kNone = ~uint64_t{0};
  static constexpr uint64_t kSpanWords = NodeSpans::kSpanWords;

  // The functions of a NodeIndex for loops over many offsets. They are always inlined, so that
  // sources that are compiled for different instruction sets can call them. The index must outlive
  // the Lookup.
  struct Lookup {
    const NodeWords* words = nullptr;  // null for bricks
    uint64_t word_count = 0;

    VOXDAG_INLINE uint64_t find(uint64_t offset) const {
      if (offset >= word_count) return kNone;
      if (!words) return offset % 2 == 0 ? offset / 2 : kNone;
      const NodeWords& found = words[offset / 64];
      const uint64_t bit = uint64_t{1} << offset % 64;
      if (!(found.starts & bit)) return kNone;
      return found.before + static_cast<uint64_t>(__builtin_popcountll(found.starts & (bit - 1)));
    }
    // Prefetches the memory that find() reads.
    VOXDAG_PREFETCH void prefetch(uint64_t offset) const {
      if (words && offset < word_count) __builtin_prefetch(&words[offset / 64]);
    }
  };

  NodeIndex() = default;
  // Walks the words of the level on up to `threads` threads. Throws Error{kCorrupt} unless every
  // child mask is 1 to 255, the last node ends with the level, and the level has as many nodes as
  // the header says. The message begins with `where`. If `pages` is not null, reports to it the
  // bytes that were read.
  NodeIndex(const voxdag_reader::Level& level, Pointers pointers, unsigned threads,
            MemoryBudget& budget, const CancelToken& cancel, const std::string& where,
            PageLimit* pages = nullptr);
  // Makes an index of the spans `first` to `end` - 1 of a level. Only find() and lookup() may be
  // used. Their offsets and indexes count from the first word, and from the first node that begins,
  // in these spans.
  NodeIndex(const NodeSpans& spans, uint64_t first, uint64_t end, unsigned threads,
            MemoryBudget& budget);

  // Returns the index of the node that begins at `offset`; kNone if no node begins there.
  uint64_t find(uint64_t offset) const { return lookup().find(offset); }
  Lookup lookup() const { return {words_.data(), level_.word_count}; }

  // To visit all nodes of the level, call visit_span() for the spans 0 to span_count() - 1, on any
  // threads. visit_span() calls visit(index, offset) for the nodes that begin in the span, in
  // order.
  uint64_t span_count() const { return (level_.word_count + kSpanWords - 1) / kSpanWords; }
  template <class Visit>
  void visit_span(uint64_t span, Visit&& visit) const {
    const uint64_t end = std::min(level_.word_count, (span + 1) * kSpanWords);
    if (pointers_ == Pointers::kNone) {
      for (uint64_t at = span * kSpanWords; at < end; at += 2) visit(at / 2, at);
      return;
    }
    uint64_t index = words_[span * kSpanWords / 64].before;
    for (uint64_t i = span * kSpanWords / 64; i * 64 < end; ++i)
      for (uint64_t bits = words_[i].starts; bits != 0; bits &= bits - 1)
        visit(index++, i * 64 + static_cast<uint64_t>(std::countr_zero(bits)));
  }
  // Returns the word offset of the last node that begins before the span. The span must not be the
  // first.
  uint64_t last_before(uint64_t span) const;

 private:
  void count_before(uint64_t spans, uint64_t span_words, unsigned threads);

  voxdag_reader::Level level_;
  Pointers pointers_ = Pointers::kNone;
  PageBuffer<NodeWords> words_;
};

}  // namespace voxdag
