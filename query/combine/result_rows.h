// Records that pass between the levels while two DAGs are combined.
//
// A *pair* is two cubes of the same level and position, one of each file. It is stored as a
// NodePair: `a` and `b` are the word offsets of the cubes' nodes in the first and the second file.
// The pairs of a level are sorted by `a`, then by `b`, and numbered in this order. A *place* is a
// child of a pair. Its number is 8 * number of the pair + index of the child. The result of a place
// is the node of the new file at this place, or empty.
#pragma once

#include <cstdint>
#include <tuple>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/node_hash.h"
#include "core/format/global/global_writer.h"
#include "query/combine/operation.h"

namespace voxdag::query {

// A node or a brick while levels are combined. Rows are compared in the total order of
// docs/format.md.
struct Row {
  uint64_t hash = 0;          // truncated to the hash bits of the file
  uint32_t mask = 0;          // child mask; 0 for a brick
  uint32_t count = 0;         // number of children; 1 for a brick
  uint64_t children[8] = {};  // word offsets; for a brick, children[0] is its mask
};

// Returns a negative number if `a` is before `b`, 0 if they are equal, otherwise a positive number.
inline int compare_rows(const Row& a, const Row& b) {
  if (a.hash != b.hash) return a.hash < b.hash ? -1 : 1;
  if (a.mask != b.mask) return a.mask < b.mask ? -1 : 1;
  for (uint32_t i = 0; i < a.count; ++i)
    if (a.children[i] != b.children[i]) return a.children[i] < b.children[i] ? -1 : 1;
  return 0;
}

inline Row brick_row(uint64_t mask, uint32_t hash_bits) {
  Row row;
  row.hash = truncate_hash(hash_brick(mask), hash_bits);
  row.count = 1;
  row.children[0] = mask;
  return row;
}

constexpr uint64_t place_of(uint64_t pair, int child) {
  return 8 * pair + static_cast<uint64_t>(child);
}
constexpr uint64_t pair_of(uint64_t place) { return place / 8; }
constexpr int child_of(uint64_t place) { return static_cast<int>(place % 8); }

// A request to combine a pair of cubes. Its result is the result of `place`, a child of a pair.
struct PairRequest {
  NodePair cubes;
  uint64_t place = 0;
  friend auto operator<=>(const PairRequest&, const PairRequest&) = default;
};

// A place (a child of a pair) whose result is the result of pair `pair` of the next finer level.
struct PairUse {
  uint64_t pair = 0;
  uint64_t place = 0;
};

// A place (a child of a pair) whose result is the node at word `offset` of one of the files.
struct NodeUse {
  uint64_t offset = 0;
  uint64_t place = 0;
  friend auto operator<=>(const NodeUse&, const NodeUse&) = default;
};

// A place (a child of a pair) whose counts change by `sign` times the counts of the node at word
// `offset` of one of the files.
struct CountUse {
  uint64_t offset = 0;
  uint64_t place = 0;
  int64_t sign = 1;
  friend auto operator<=>(const CountUse&, const CountUse&) = default;
};

// A change of counts. In lists of places, `key` is the number of a place; in lists of pairs, it is
// the number of a pair. The counts are unsigned and wrap around modulo 2^64, so the change -1 is
// stored as 2^64 - 1.
struct KeyedCounts {
  uint64_t key = 0;
  OctreeCounts counts;
  friend bool operator<(const KeyedCounts& a, const KeyedCounts& b) { return a.key < b.key; }
};

// A node of the new file.
struct NewNode {
  uint64_t position = 0;  // word offset in its level
  uint64_t hash = 0;
};

// The node of the new file that is the result of a place or of a pair. In lists of places, `key` is
// the number of the place; in lists of pairs, it is the number of the pair.
struct KeyedNode {
  uint64_t key = 0;
  NewNode node;
  friend bool operator<(const KeyedNode& a, const KeyedNode& b) { return a.key < b.key; }
};

// The result of a pair, as a Row. `pair` is the number of the pair.
struct PairRow {
  Row row;
  uint64_t pair = 0;
  friend bool operator<(const PairRow& a, const PairRow& b) {
    const int order = compare_rows(a.row, b.row);
    return order != 0 ? order < 0 : a.pair < b.pair;
  }
};

// Appends rows to a level of the new file.
class RowWriter {
 public:
  RowWriter(GlobalFileWriter& out, bool wide, MemoryBudget& budget)
      : out_(out), wide_(wide), words_(budget, kBufferWords, "words of a level") {}

  uint64_t nodes() const { return nodes_; }
  uint64_t words() const { return written_ + count_; }
  // Appends the row. Returns the word offset in the new level at which it begins.
  uint64_t add(const Row& row) {
    if (count_ + kMaxRowWords > kBufferWords) flush();
    const uint64_t position = words();
    ++nodes_;
    if (row.mask == 0) {
      put_wide(row.children[0]);
      return position;
    }
    words_[count_++] = row.mask;
    for (uint32_t i = 0; i < row.count; ++i)
      if (wide_)
        put_wide(row.children[i]);
      else
        words_[count_++] = static_cast<uint32_t>(row.children[i]);
    return position;
  }
  void flush() {
    out_.checksum_words({words_.data(), count_});
    out_.write_words(written_, {words_.data(), count_});
    written_ += count_;
    count_ = 0;
  }

 private:
  static constexpr uint64_t kBufferWords = uint64_t{1} << 16;
  static constexpr uint64_t kMaxRowWords = 17;
  void put_wide(uint64_t number) {
    words_[count_++] = static_cast<uint32_t>(number);
    words_[count_++] = static_cast<uint32_t>(number >> 32);
  }

  GlobalFileWriter& out_;
  const bool wide_;
  PageBuffer<uint32_t> words_;
  uint64_t count_ = 0;    // words in the buffer
  uint64_t written_ = 0;  // words in the file
  uint64_t nodes_ = 0;
};

}  // namespace voxdag::query
