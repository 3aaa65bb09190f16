// The rows of a merge, and the merge's terms, each with one meaning:
//
//   row             one node or brick of one artifact: hash, mask and words
//   run             the rows of one level of one artifact (or of the top tree), in the total order
//   frame           a block of up to kFrameRows consecutive rows of a run, as artifacts store them
//   hash partition  a contiguous range of the hash space, merged as one unit: the rows of
//                   all runs in this range are in memory together
//   bucket          an equal share of a hash partition's range, whose rows one thread sorts
//   position        place of a row in the merged level: its word offset if the level is in the
//                   global file, its index if the level is in an artifact
//
// A node's words are its children, one word each. In a wide level a child takes two words, the high
// half first. A brick is represented as a node of mask 3 whose two words are the high and the low
// half of its voxel mask. So the total order of bricks and of nodes is the order by hash, then by
// mask, then by the words.
//
// The memory after a row is readable: kMaxRowWords words from the first word of any row, even if
// the row has fewer words. So a row is copied without a branch on its number of words, which the
// CPU would often mispredict.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/base/popcount8.h"
#include "core/dag/level_array.h"

namespace voxdag {

inline constexpr uint8_t kBrickRowMask = 3;
inline constexpr uint32_t kBrickWords = 2;
inline constexpr uint32_t kMaxRowWords = 16;

// How the rows of a level are represented: as bricks or as nodes, and with children of one word or
// of two words.
struct RowFormat {
  bool bricks = false;
  bool wide = false;  // children take two words

  uint32_t words(uint8_t mask) const { return uint32_t{kPopcount8[mask]} << wide; }
  uint32_t max_words() const { return uint32_t{8} << wide; }
};

// Writes a position to `to`: as one word or, if `wide` is set, as two words, the high half first.
// Returns the end of the written words.
inline uint32_t* put_position(uint32_t* to, uint64_t position, bool wide) {
  if (wide) *to++ = static_cast<uint32_t>(position >> 32);
  *to++ = static_cast<uint32_t>(position);
  return to;
}
inline uint64_t get_position(const uint32_t* from, bool wide) {
  return wide ? uint64_t{from[0]} << 32 | from[1] : from[0];
}

// Number of rows and their total number of words.
struct RowCount {
  uint64_t rows = 0;
  uint64_t words = 0;

  void add(const RowCount& more) {
    rows += more.rows;
    words += more.words;
  }
  void raise_to(const RowCount& other) {
    rows = std::max(rows, other.rows);
    words = std::max(words, other.words);
  }
};

struct RowKey {
  uint64_t hash = 0;
  uint8_t mask = 0;
  const uint32_t* words = nullptr;
};

// Returns a negative number, 0 or a positive number if `a` is before, equal to or after `b` in the
// total order.
inline int compare_rows(const RowFormat& format, const RowKey& a, const RowKey& b) {
  if (a.hash != b.hash) return a.hash < b.hash ? -1 : 1;
  if (a.mask != b.mask) return a.mask < b.mask ? -1 : 1;
  return compare_children(a.words, b.words, static_cast<int>(format.words(a.mask)));
}

}  // namespace voxdag
