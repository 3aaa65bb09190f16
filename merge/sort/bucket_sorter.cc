#include "merge/sort/bucket_sorter.h"

#include <algorithm>
#include <bit>

#include "core/base/host_device.h"

namespace voxdag {
namespace {

// If more rows than this have equal digits (see distribute()), std::sort() sorts them before the
// insertion sort, which is fast for a few rows only.
constexpr uint32_t kMaxInsertionRows = 32;
// The rows of a slice are prefetched this many slices before they are read. A bucket has only a few
// rows of each slice, and the slices are at scattered addresses.
constexpr size_t kSlicesAhead = 8;

template <class T>
VOXDAG_PREFETCH void prefetch(const T* begin, const T* end) {
  constexpr uintptr_t kLine = 64;
  for (auto p = reinterpret_cast<uintptr_t>(begin) / kLine * kLine;
       p < reinterpret_cast<uintptr_t>(end); p += kLine)
    __builtin_prefetch(reinterpret_cast<const void*>(p));
}

VOXDAG_PREFETCH void prefetch_rows(const HashPartition& partition, size_t bucket, size_t slice) {
  if (slice >= partition.slices().size()) return;
  const uint64_t base = partition.slices()[slice].row_base;
  const RowOffset begin = partition.bucket_begin(bucket, slice);
  const RowOffset end = partition.bucket_begin(bucket + 1, slice);
  prefetch(partition.hashes() + base + begin.row, partition.hashes() + base + end.row);
  prefetch(partition.masks() + base + begin.row, partition.masks() + base + end.row);
}

}  // namespace

BucketSorter::BucketSorter(MemoryBudget& budget, const RowFormat& format, const RowCount& max)
    : format_(format),
      entries_(budget, max.rows, "a bucket of the merge"),
      positions_(budget, max.rows, "a bucket of the merge"),
      digit_ends_(budget, 2 * max.rows + 2, "a bucket of the merge"),
      unique_(budget, format, max) {}

uint64_t BucketSorter::bytes_for(const RowCount& max) {
  return max.rows * (sizeof(Entry) + 4 + 8) + MergedRows::bytes_for(max);
}

void BucketSorter::sort(const HashPartition& partition, size_t bucket, bool in_words) {
  words_ = partition.words();
  distribute(partition, bucket);
  emit_unique(in_words);
}

// Fills entries_ with the bucket's rows in the order of their hashes. First distributes the rows by
// a digit of their hashes, then sorts the rows with equal digits. The digit consists of the highest
// bits below the bits that are equal in all hashes of the bucket.
void BucketSorter::distribute(const HashPartition& partition, size_t bucket) {
  const auto slices = partition.slices();
  size_t rows = 0;
  for (size_t s = 0; s < slices.size(); ++s)
    rows += partition.bucket_begin(bucket + 1, s).row - partition.bucket_begin(bucket, s).row;
  row_count_ = rows;
  if (rows == 0) return;
  const unsigned bits = std::min<unsigned>(std::bit_width(rows), partition.bucket_bits());
  const unsigned shift = partition.bucket_bits() - bits;
  const uint64_t digit_mask = (uint64_t{1} << bits) - 1;
  const auto digit = [&](uint64_t hash) { return hash >> shift & digit_mask; };

  uint32_t* const ends = digit_ends_.data();
  std::fill_n(ends, digit_mask + 2, 0);
  for (size_t s = 0; s < slices.size(); ++s) {
    const RowOffset begin = partition.bucket_begin(bucket, s);
    const RowOffset end = partition.bucket_begin(bucket + 1, s);
    const uint64_t* const hashes = partition.hashes() + slices[s].row_base;
    prefetch_rows(partition, bucket, s + kSlicesAhead);
    prefetch(words_ + slices[s].word_base + begin.word, words_ + slices[s].word_base + end.word);
    for (uint32_t i = begin.row; i < end.row; ++i) ++ends[digit(hashes[i]) + 1];
  }
  for (size_t d = 0; d < digit_mask; ++d) ends[d + 1] += ends[d];

  uint32_t row = 0;
  for (size_t s = 0; s < slices.size(); ++s) {
    const RowOffset begin = partition.bucket_begin(bucket, s);
    const RowOffset end = partition.bucket_begin(bucket + 1, s);
    const uint64_t* const hashes = partition.hashes() + slices[s].row_base;
    const uint8_t* const masks = partition.masks() + slices[s].row_base;
    uint32_t word = static_cast<uint32_t>(slices[s].word_base + begin.word);
    for (uint32_t i = begin.row; i < end.row; ++i) {
      entries_[ends[digit(hashes[i])]++] = {hashes[i], row++ | uint32_t{masks[i]} << 24, word};
      word += format_.words(masks[i]);
    }
  }
  sort_digits(digit_mask + 1);
}

void BucketSorter::sort_digits(size_t digit_count) {
  Entry* const entries = entries_.data();
  uint32_t begin = 0;
  for (size_t d = 0; d < digit_count; ++d) {
    const uint32_t end = digit_ends_[d];
    if (end - begin > kMaxInsertionRows)
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

bool BucketSorter::same_row(const Entry& a, const Entry& b) const {
  if (a.mask() != b.mask()) return false;
  const uint32_t* const x = words_ + a.word;
  const uint32_t* const y = words_ + b.word;
  for (uint32_t i = 0; i < format_.words(a.mask()); ++i)
    if (x[i] != y[i]) return false;
  return true;
}

// Collects the unique rows and the position of every row. Usually all rows with the same hash are
// equal: one row, or copies from several runs. Otherwise, the rows with this hash are sorted.
void BucketSorter::emit_unique(bool in_words) {
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
      std::sort(entries + begin, entries + end, [&](const Entry& x, const Entry& y) {
        return compare_rows(format_, key(x), key(y)) < 0;
      });
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
