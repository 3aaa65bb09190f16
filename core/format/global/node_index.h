// Finds the word offsets at which the nodes of a level of the global file begin. Nodes vary in
// size, so this requires a walk over the level from its first word. To use several threads, the
// level is cut into spans. Each span but the first is walked from a word that looks like the
// beginning of a node. If the last node of the previous span does not end at this word, the span is
// walked again.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>

#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/base/popcount8.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag {

class PageLimit;

// The kind of child pointers in the nodes of a level. Bricks have none.
enum class Pointers { kNone, kNarrow, kWide };

// Describes 64 words of a level, or of a part of it that begins at a multiple of 64 words.
struct NodeWords {
  uint64_t starts = 0;  // one bit per word: set if a node begins there
  uint64_t before = 0;  // number of the part's nodes that begin before the 64 words
};

// The first and the last node that begin in each span of a level. Takes 32 bytes of memory per
// span, and nothing for bricks. Immutable after construction.
class NodeSpans {
 public:
  static constexpr uint64_t kSpanWords = uint64_t{1} << 16;

  NodeSpans() = default;
  // Walks the words of the level on up to `threads` threads. Throws Error{kCorrupt} unless every
  // child mask is 1 to 255, the last node ends with the level, and the level has as many nodes as
  // the header says. The message begins with `where`. If `pages` is not null, reports to it the
  // bytes that were read. `span_words` must be a multiple of 64. If `marks` is not null, it has
  // word_count / 64 + 1 elements; sets `starts` in all of them, and `before` at the beginning of
  // each span.
  NodeSpans(const voxdag_reader::Level& level, Pointers pointers, unsigned threads,
            MemoryBudget& budget, const CancelToken& cancel, const std::string& where,
            PageLimit* pages, uint64_t span_words = kSpanWords, NodeWords* marks = nullptr);

  const voxdag_reader::Level& level() const { return level_; }
  Pointers pointers() const { return pointers_; }
  uint64_t span_words() const { return span_words_; }
  uint64_t size() const { return (level_.word_count + span_words_ - 1) / span_words_; }
  // Returns the number of nodes that begin before the span. `span` can be size().
  uint64_t nodes_before(uint64_t span) const {
    if (span >= size()) return level_.node_count;
    return pointers_ == Pointers::kNone ? span * span_words_ / 2 : spans_[span].before;
  }
  // Returns the word offset of the last node that begins before the span. The span must not be the
  // first.
  uint64_t last_before(uint64_t span) const {
    return pointers_ == Pointers::kNone ? span * span_words_ - 2 : spans_[span - 1].last;
  }
  // Calls visit(index, offset) for the nodes that begin in the span, in order.
  template <class Visit>
  void visit_span(uint64_t span, Visit&& visit) const {
    const uint64_t end = nodes_before(span + 1);
    uint64_t index = nodes_before(span);
    uint64_t at = pointers_ == Pointers::kNone ? span * span_words_ : spans_[span].begin;
    for (; index < end && at < level_.word_count; ++index) {
      visit(index, at);
      at += pointers_ == Pointers::kNone
                ? 2
                : 1 + (uint64_t{kPopcount8[level_.words[at] & 0xff]} << is_wide());
    }
  }

 private:
  struct Span {
    uint64_t begin = 0;   // word offset of its first node
    uint64_t last = 0;    // word offset of its last node
    uint64_t before = 0;  // number of nodes that begin before it
    uint32_t nodes = 0;
    uint16_t last_words = 0;  // words of its last node
    bool is_broken = false;   // no node can begin at its end
    // Returns the word offset of the end of its last node.
    uint64_t end() const { return last + last_words; }
  };

  bool is_wide() const { return pointers_ == Pointers::kWide; }
  uint64_t words_of_node(uint64_t at) const;
  uint64_t guess_begin(uint64_t span) const;
  Span walk(uint64_t span, uint64_t begin, NodeWords* marks) const;
  uint64_t join(NodeWords* marks, const CancelToken& cancel, const std::string& where);

  voxdag_reader::Level level_;
  Pointers pointers_ = Pointers::kNone;
  uint64_t span_words_ = kSpanWords;
  PageBuffer<Span> spans_;
};

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
  // in these spans. Reports to `pages` the bytes that were read.
  NodeIndex(const NodeSpans& spans, uint64_t first, uint64_t end, unsigned threads,
            MemoryBudget& budget, PageLimit& pages);

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
