// Scratch files that are written and read span by span:
//
//   SpanFile    a part of 32-bit words for each span of a level
//   SpanLists   lists of items for each span, one list for each bucket
//
// Several threads may use different spans concurrently. Reading returns the words that were
// written, or throws Error{kCorrupt}.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/verify/verify_scratch.h"

namespace voxdag {

// Takes 24 bytes of memory per span.
class SpanFile {
 public:
  SpanFile(VerifyScratch& scratch, MemoryBudget& budget, uint64_t spans)
      : file_(scratch), parts_(budget, spans, "an index of temporary files") {}

  // Makes room for the words of a span. Call it before the first append().
  void reserve(uint64_t span, uint64_t words) { parts_[span].begin = end_.fetch_add(words); }
  void append(uint64_t span, std::span<const uint32_t> words);
  // Returns the number of words that were appended.
  uint64_t words(uint64_t span) const { return parts_[span].words; }
  // Reads all words of the span.
  void read(uint64_t span, std::span<uint32_t> words) const;
  // Reads a piece of the span's words. The pieces must not overlap. Once the pieces are complete,
  // finish_pieces() checks that they are right.
  void read_piece(uint64_t span, uint64_t first, std::span<uint32_t> words);
  void finish_pieces(uint64_t span) const {
    if (parts_[span].sum != 0) damaged(span);
  }
  [[noreturn]] void damaged(uint64_t span) const;

 private:
  struct Part {
    uint64_t begin = 0;  // position of its first word in the file
    uint64_t words = 0;
    uint64_t sum = 0;  // indexed_checksum() of its words, without the pieces that were read
  };

  UnnamedFile file_;
  PageBuffer<Part> parts_;
  std::atomic<uint64_t> end_{0};
};

// The memory does not depend on the number of buckets: the number of items of a list is in the file
// before the list, and is read together with the previous list.
class SpanLists {
 public:
  // Memory of a thread.
  struct Buffer {
    std::vector<uint32_t> words;
    std::vector<uint64_t> next, end;  // by bucket: words of the lists that are filled
  };

  // An item has `item_words` words.
  SpanLists(VerifyScratch& scratch, MemoryBudget& budget, uint64_t spans, uint64_t buckets,
            uint32_t item_words)
      : buckets_(buckets),
        item_words_(item_words),
        file_(scratch, budget, spans),
        cursors_(budget, spans, "lists of nodes") {}

  uint64_t buckets() const { return buckets_; }
  // Writes the lists of a span. visit(add) calls add(bucket, item) for all items; `item` points to
  // the words of the item. Calls visit() twice. Returns the number of items.
  template <class Visit>
  uint64_t write(uint64_t span, Buffer& buffer, const Visit& visit) {
    buffer.end.assign(buckets_, 0);
    uint64_t items = 0;
    visit([&](uint64_t bucket, const uint32_t*) {
      ++buffer.end[bucket];
      ++items;
    });
    lay_out(buffer);
    cursors_[span] = {0, static_cast<uint32_t>(buffer.end[0] / item_words_)};
    visit([&](uint64_t bucket, const uint32_t* item) {
      uint64_t& next = buffer.next[bucket];
      if (next == buffer.end[bucket]) return;  // only possible if the level has changed
      std::memcpy(&buffer.words[next], item, item_words_ * sizeof(uint32_t));
      next += item_words_;
    });
    file_.reserve(span, buffer.words.size());
    file_.append(span, buffer.words);
    return items;
  }
  // Returns the number of items in a list that write() has just laid out in `buffer`.
  uint64_t items(const Buffer& buffer, uint64_t bucket) const {
    const uint64_t begin = bucket == 0 ? 0 : buffer.end[bucket - 1] + 1;
    return (buffer.end[bucket] - begin) / item_words_;
  }
  // Returns the words of the span's items in the bucket. The buckets must be read in order, from 0.
  // The result is valid while `buffer` is unchanged.
  std::span<const uint32_t> next(uint64_t span, uint64_t bucket, Buffer& buffer);
  [[noreturn]] void damaged(uint64_t span) const { file_.damaged(span); }

 private:
  struct Cursor {
    uint32_t at = 0;     // position of the next list in the span's part
    uint32_t items = 0;  // items of the next list
  };
  void lay_out(Buffer& buffer) const;

  const uint64_t buckets_;
  const uint32_t item_words_;
  SpanFile file_;
  PageBuffer<Cursor> cursors_;
};

}  // namespace voxdag
