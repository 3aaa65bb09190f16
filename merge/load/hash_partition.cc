#include "merge/load/hash_partition.h"

#include <algorithm>
#include <bit>

namespace voxdag {
namespace {

// Returns b, for buckets (hash_partition.h) that cover 2^b hashes each. If the hashes are spread
// evenly, a bucket has about `bucket_rows` rows. With many slices, a bucket has more rows, so that
// bucket_begins_ (one entry per bucket and slice) takes at most about four bytes per row.
unsigned choose_bucket_bits(const HashInterval& interval, uint64_t rows, uint64_t bucket_rows,
                            size_t slices) {
  const uint64_t max_buckets = std::max<uint64_t>(
      1, std::min(rows / std::max<uint64_t>(1, bucket_rows), rows / (4 * slices + 1)));
  unsigned bits = 0;
  while (bits < 63 && (interval.last >> bits) - (interval.first >> bits) >= 2 * max_buckets) ++bits;
  return bits;
}

}  // namespace

uint64_t HashPartition::bytes_for(const RowCount& count, uint32_t position_words) {
  // Memory per row: hash, mask, bucket_begins_ (at most 4 bytes; see choose_bucket_bits()) and
  // position. Memory per word: the word itself, and one bit while children are replaced.
  return count.rows * (8 + 1 + 4 + 4 * position_words) + count.words * 4 + count.words / 8;
}

std::vector<RunSlice> HashPartition::slices_within(std::span<const LevelRun* const> runs,
                                                   const HashInterval& interval) {
  std::vector<RunSlice> slices;
  for (size_t run = 0; run < runs.size(); ++run) {
    const FrameSpan frames = runs[run]->frames_within(interval);
    if (frames.begin < frames.end) slices.push_back({.run = run, .frames = frames});
  }
  return slices;
}

std::optional<HashInterval> HashPartition::widest_interval(std::span<const LevelRun* const> runs,
                                                           uint64_t first, uint64_t bytes,
                                                           uint32_t position_words) {
  bytes = std::min(bytes, kMaxPartitionBytes);
  const auto fits = [&](uint64_t last) {
    RowCount total;
    for (const LevelRun* run : runs) total.add(run->count(run->frames_within({first, last})));
    return bytes_for(total, position_words) <= bytes;
  };
  if (fits(~uint64_t{0})) return HashInterval{first, ~uint64_t{0}};
  if (!fits(first)) return std::nullopt;
  uint64_t last = first, too_far = ~uint64_t{0};
  while (too_far - last > 1) {
    const uint64_t middle = last + (too_far - last) / 2;
    (fits(middle) ? last : too_far) = middle;
  }
  return HashInterval{first, last};
}

HashPartition::HashPartition(std::span<const LevelRun* const> runs, std::vector<RunSlice> slices,
                             const HashInterval& interval, uint64_t bucket_rows,
                             uint32_t position_words, PartitionMemory& memory, MemoryBudget& budget)
    : runs_(runs), slices_(std::move(slices)), interval_(interval), memory_(memory) {
  RowCount total;
  for (RunSlice& slice : slices_) {
    const LevelRun& run = *runs_[slice.run];
    slice.first_row = run.rows_before(slice.frames.begin);
    slice.size = run.count(slice.frames);
    slice.row_base = total.rows;
    slice.word_base = total.words;
    total.add(slice.size);
  }
  bucket_bits_ = choose_bucket_bits(interval_, total.rows, bucket_rows, slices_.size());
  bucket_count_ = (interval_.last >> bucket_bits_) - (interval_.first >> bucket_bits_) + 1;
  memory_.reserve(total, position_words, budget);
  bucket_begins_ = PageBuffer<RowOffset>(budget, (bucket_count_ + 1) * slices_.size(),
                                         "the buckets of a hash partition");
}

void PartitionMemory::reserve(const RowCount& count, uint32_t position_words,
                              MemoryBudget& budget) {
  const uint64_t rows = count.rows, words = count.words + kMaxRowWords;
  if (rows <= hashes_.size() && words <= words_.size() &&
      position_words * rows <= positions_.size())
    return;
  release();  // frees all columns before it allocates any
  hashes_ = PageBuffer<uint64_t>(budget, rows, "a hash partition of the merge");
  masks_ = PageBuffer<uint8_t>(budget, rows, "a hash partition of the merge");
  words_ = PageBuffer<uint32_t>(budget, words, "a hash partition of the merge");
  if (position_words > 0)
    positions_ =
        PageBuffer<uint32_t>(budget, position_words * rows, "a hash partition of the merge");
}

uint64_t PartitionMemory::bytes() const {
  return hashes_.size() * sizeof(uint64_t) + masks_.size() +
         (words_.size() + positions_.size()) * sizeof(uint32_t);
}

}  // namespace voxdag
