#include "merge/load/slab.h"

#include <algorithm>
#include <bit>

namespace voxdag {
namespace {

struct Extent {
  uint64_t rows = 0;
  uint64_t words = 0;
};

Extent extent_of(const LevelRun& run, const FrameSpan& frames) {
  return {run.rows_before(frames.end) - run.rows_before(frames.begin),
          run.words_before(frames.end) - run.words_before(frames.begin)};
}

// Bits of a range: the fewest for which ranges of even hashes hold `range_rows` rows, and for which
// the table of bounds takes at most a byte or two a row.
unsigned choose_range_bits(const HashInterval& interval, uint64_t rows, uint64_t range_rows,
                           size_t pieces) {
  const uint64_t max_ranges = std::max<uint64_t>(
      1, std::min(rows / std::max<uint64_t>(1, range_rows), rows / (4 * pieces + 1)));
  unsigned bits = 0;
  while (bits < 63 && (interval.last >> bits) - (interval.first >> bits) >= 2 * max_ranges) ++bits;
  return bits;
}

}  // namespace

uint64_t Slab::bytes_for(uint64_t rows, uint64_t words, bool with_positions) {
  // Hash, mask, bounds (see choose_range_bits); words, and a bit for each while they are rewired.
  return rows * (8 + 1 + 4 + (with_positions ? 4 : 0)) + words * 4 + words / 8;
}

std::vector<SlabPiece> Slab::pieces_within(std::span<const LevelRun* const> runs,
                                           const HashInterval& interval) {
  std::vector<SlabPiece> pieces;
  for (size_t run = 0; run < runs.size(); ++run) {
    const FrameSpan frames = runs[run]->frames_within(interval);
    if (frames.begin < frames.end) pieces.push_back({.run = run, .frames = frames});
  }
  return pieces;
}

std::optional<HashInterval> Slab::widest_interval(std::span<const LevelRun* const> runs,
                                                  uint64_t first, uint64_t bytes,
                                                  bool with_positions) {
  bytes = std::min(bytes, kLargestSlabBytes);
  const auto fits = [&](uint64_t last) {
    Extent sum;
    for (const LevelRun* run : runs) {
      const Extent extent = extent_of(*run, run->frames_within({first, last}));
      sum.rows += extent.rows;
      sum.words += extent.words;
    }
    return bytes_for(sum.rows, sum.words, with_positions) <= bytes;
  };
  if (fits(~uint64_t{0})) return HashInterval{first, ~uint64_t{0}};
  if (!fits(first)) return std::nullopt;
  uint64_t good = first, bad = ~uint64_t{0};
  while (bad - good > 1) {
    const uint64_t middle = good + (bad - good) / 2;
    (fits(middle) ? good : bad) = middle;
  }
  return HashInterval{first, good};
}

Slab::Slab(std::span<const LevelRun* const> runs, std::vector<SlabPiece> pieces,
           const HashInterval& interval, uint64_t range_rows, bool with_positions,
           SlabMemory& memory, MemoryBudget& budget)
    : runs_(runs), pieces_(std::move(pieces)), interval_(interval), memory_(memory) {
  uint64_t rows = 0, words = 0;
  for (SlabPiece& piece : pieces_) {
    const LevelRun& run = *runs_[piece.run];
    const Extent extent = extent_of(run, piece.frames);
    piece.first_row = run.rows_before(piece.frames.begin);
    piece.rows = extent.rows;
    piece.words = extent.words;
    piece.row_base = rows;
    piece.word_base = words;
    rows += extent.rows;
    words += extent.words;
  }
  range_bits_ = choose_range_bits(interval_, rows, range_rows, pieces_.size());
  range_count_ = (interval_.last >> range_bits_) - (interval_.first >> range_bits_) + 1;
  memory_.reserve(rows, words, with_positions, budget);
  bounds_ =
      PageBuffer<SlabBound>(budget, (range_count_ + 1) * pieces_.size(), "a merge slab's ranges");
}

void SlabMemory::reserve(uint64_t rows, uint64_t words, bool with_positions, MemoryBudget& budget) {
  words += kLongestRowWords;
  if (rows <= hashes_.size() && words <= words_.size() &&
      (!with_positions || rows <= positions_.size()))
    return;
  release();  // all of them, so that no more is ever held than one slab took
  hashes_ = PageBuffer<uint64_t>(budget, rows, "a merge slab");
  masks_ = PageBuffer<uint8_t>(budget, rows, "a merge slab");
  words_ = PageBuffer<uint32_t>(budget, words, "a merge slab");
  if (with_positions) positions_ = PageBuffer<uint32_t>(budget, rows, "a merge slab");
}

uint64_t SlabMemory::bytes() const {
  return hashes_.size() * sizeof(uint64_t) + masks_.size() +
         (words_.size() + positions_.size()) * sizeof(uint32_t);
}

}  // namespace voxdag
