#include "merge/sort/range_sweep.h"

#include <algorithm>
#include <bit>

namespace voxdag {
namespace {

// Buckets of more rows are sorted by comparison before the insertion sort runs over all.
constexpr uint32_t kManyRows = 32;
// Every piece has a few rows in a range, somewhere in memory: they are asked for so many pieces
// ahead.
constexpr size_t kPiecesAhead = 8;

template <class T>
void prefetch(const T* begin, const T* end) {
  constexpr uintptr_t kLine = 64;
  for (auto p = reinterpret_cast<uintptr_t>(begin) / kLine * kLine;
       p < reinterpret_cast<uintptr_t>(end); p += kLine)
    __builtin_prefetch(reinterpret_cast<const void*>(p));
}

void prefetch_rows(const Slab& slab, size_t range, size_t piece) {
  if (piece >= slab.pieces().size()) return;
  const SlabPiece& p = slab.pieces()[piece];
  const SlabBound begin = slab.bound(range, piece), end = slab.bound(range + 1, piece);
  prefetch(slab.hashes() + p.row_base + begin.row, slab.hashes() + p.row_base + end.row);
  prefetch(slab.masks() + p.row_base + begin.row, slab.masks() + p.row_base + end.row);
}

}  // namespace

RangeSweeper::RangeSweeper(MemoryBudget& budget, bool bricks, uint64_t rows, uint64_t words)
    : entries_(budget, rows, "a merge range"),
      positions_(budget, rows, "a merge range"),
      bucket_ends_(budget, 2 * rows + 2, "a merge range"),
      unique_(budget, bricks, rows, words) {}

uint64_t RangeSweeper::bytes_for(uint64_t rows, uint64_t words) {
  return rows * (sizeof(Entry) + 4 + 8) + RecordBatch::bytes_for(rows, words);
}

void RangeSweeper::sweep(const Slab& slab, size_t range, bool in_words) {
  words_ = slab.words();
  distribute(slab, range);
  emit_groups(in_words);
}

// Fills entries_ in the order of the hash.
void RangeSweeper::distribute(const Slab& slab, size_t range) {
  const auto pieces = slab.pieces();
  size_t rows = 0;
  for (size_t p = 0; p < pieces.size(); ++p)
    rows += slab.bound(range + 1, p).row - slab.bound(range, p).row;
  row_count_ = rows;
  if (rows == 0) return;
  const unsigned bits = std::min<unsigned>(std::bit_width(rows), slab.range_bits());
  const unsigned shift = slab.range_bits() - bits;
  const uint64_t bucket_mask = (uint64_t{1} << bits) - 1;
  const auto bucket = [&](uint64_t hash) { return hash >> shift & bucket_mask; };

  uint32_t* const ends = bucket_ends_.data();
  std::fill_n(ends, bucket_mask + 2, 0);
  for (size_t p = 0; p < pieces.size(); ++p) {
    const SlabBound begin = slab.bound(range, p), end = slab.bound(range + 1, p);
    const uint64_t* const hashes = slab.hashes() + pieces[p].row_base;
    prefetch_rows(slab, range, p + kPiecesAhead);
    prefetch(words_ + pieces[p].word_base + begin.word, words_ + pieces[p].word_base + end.word);
    for (uint32_t i = begin.row; i < end.row; ++i) ++ends[bucket(hashes[i]) + 1];
  }
  for (size_t b = 0; b < bucket_mask; ++b) ends[b + 1] += ends[b];

  uint32_t row = 0;
  for (size_t p = 0; p < pieces.size(); ++p) {
    const SlabBound begin = slab.bound(range, p), end = slab.bound(range + 1, p);
    const uint64_t* const hashes = slab.hashes() + pieces[p].row_base;
    const uint8_t* const masks = slab.masks() + pieces[p].row_base;
    uint32_t word = static_cast<uint32_t>(pieces[p].word_base + begin.word);
    for (uint32_t i = begin.row; i < end.row; ++i) {
      entries_[ends[bucket(hashes[i])]++] = {hashes[i], row++ | uint32_t{masks[i]} << 24, word};
      word += kRowWords[masks[i]];
    }
  }
  sort_buckets(bucket_mask + 1);
}

void RangeSweeper::sort_buckets(size_t bucket_count) {
  Entry* const entries = entries_.data();
  uint32_t begin = 0;
  for (size_t b = 0; b < bucket_count; ++b) {
    const uint32_t end = bucket_ends_[b];
    if (end - begin > kManyRows)
      std::sort(entries + begin, entries + end,
                [](const Entry& x, const Entry& y) { return x.hash < y.hash; });
    begin = end;
  }
  for (size_t i = 1; i < row_count_; ++i) {
    if (entries[i - 1].hash <= entries[i].hash) continue;
    const Entry moved = entries[i];
    size_t to = i;
    for (; to > 0 && entries[to - 1].hash > moved.hash; --to) entries[to] = entries[to - 1];
    entries[to] = moved;
  }
}

bool RangeSweeper::same_row(const Entry& a, const Entry& b) const {
  if (a.mask() != b.mask()) return false;
  const uint32_t* const x = words_ + a.word;
  const uint32_t* const y = words_ + b.word;
  for (uint32_t i = 0; i < kRowWords[a.mask()]; ++i)
    if (x[i] != y[i]) return false;
  return true;
}

// Groups of equal hash: mostly one row, or one row in several runs.
void RangeSweeper::emit_groups(bool in_words) {
  unique_.clear();
  extent_ = 0;
  Entry* const entries = entries_.data();
  const auto key = [&](const Entry& e) { return RowKey{e.hash, e.mask(), words_ + e.word}; };
  for (size_t begin = 0, end; begin < row_count_; begin = end) {
    const Entry first = entries[begin];
    bool all_same = true;
    for (end = begin + 1; end < row_count_ && entries[end].hash == first.hash; ++end)
      all_same = all_same && same_row(first, entries[end]);
    if (!all_same)
      std::sort(entries + begin, entries + end,
                [&](const Entry& x, const Entry& y) { return compare_rows(key(x), key(y)) < 0; });
    uint32_t position = 0;
    for (size_t i = begin; i < end; ++i) {
      if (i == begin || (!all_same && !same_row(entries[i - 1], entries[i]))) {
        position = static_cast<uint32_t>(extent_);
        unique_.push(first.hash, entries[i].mask(), words_ + entries[i].word);
        extent_ = in_words ? unique_.word_count() : unique_.row_count();
      }
      positions_[entries[i].row()] = position;
    }
  }
}

}  // namespace voxdag
