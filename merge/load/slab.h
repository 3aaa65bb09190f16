// A slab: all rows of one level whose hash lies in an interval, from all runs, in memory, their
// children replaced by positions (the merge's step "rewire").
//
//   columns:   [piece of run 0] [piece of run 1] ...     whole frames, so a few rows at a piece's
//                                                         ends may lie outside the interval
//   ranges:    the interval, cut into cells of 2^range_bits hashes; bound(r, run) is where range r
//              begins in the run's piece, bound(ranges, run) where the last one ends
//
// Usually one slab holds the whole level.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/level_run.h"
#include "merge/load/position_maps.h"

namespace voxdag {

// The frames of one run that a slab holds, and where they lie in its columns.
struct SlabPiece {
  size_t run = 0;
  FrameSpan frames;
  uint64_t first_row = 0;  // of the run
  uint64_t rows = 0, words = 0;
  uint64_t row_base = 0, word_base = 0;
};

// A place in a piece: rows before it, and words of those rows.
struct SlabBound {
  uint32_t row = 0;
  uint32_t word = 0;
};

// The memory of a slab's columns. It is kept from one slab to the next, as far as there is room for
// that: pages fresh from the system take as long to be zeroed as it takes to read rows into them.
class SlabMemory {
 public:
  // Room for so many rows; what was in the columns is lost.
  void reserve(uint64_t rows, uint64_t words, bool with_positions, MemoryBudget& budget);
  void release() { *this = {}; }
  uint64_t bytes() const;

 private:
  friend class Slab;
  PageBuffer<uint64_t> hashes_;
  PageBuffer<uint8_t> masks_;
  PageBuffer<uint32_t> words_;
  PageBuffer<uint32_t> positions_;
};

// How the rows are rewired: the threads, and the memory each may use besides the slab.
struct SlabWorkers {
  unsigned count = 1;
  uint64_t bytes_each = 0;
};

// Memory of one Frame of kFrameRows rows, at most.
inline constexpr uint64_t kFrameMemory = uint64_t{640} << 10;
// Slabs stay below this, so that 32 bits count their words.
inline constexpr uint64_t kLargestSlabBytes = uint64_t{8} << 30;

class Slab {
 public:
  // `with_positions`: the slab also keeps a position for each of its rows.
  static uint64_t bytes_for(uint64_t rows, uint64_t words, bool with_positions);
  // The widest interval from hash `first` on whose slab takes at most `bytes`; none if not even the
  // rows of that one hash fit.
  static std::optional<HashInterval> widest_interval(std::span<const LevelRun* const> runs,
                                                     uint64_t first, uint64_t bytes,
                                                     bool with_positions);
  // Pieces for all frames within the interval, without their bases.
  static std::vector<SlabPiece> pieces_within(std::span<const LevelRun* const> runs,
                                              const HashInterval& interval);

  // Ranges of about `range_rows` rows, if hashes are spread evenly. At most one slab at a time lies
  // in `memory`.
  Slab(std::span<const LevelRun* const> runs, std::vector<SlabPiece> pieces,
       const HashInterval& interval, uint64_t range_rows, bool with_positions, SlabMemory& memory,
       MemoryBudget& budget);

  // Reads and rewires; `child_maps` may be null if no run needs them.
  void load(const PositionMaps* child_maps, const SlabWorkers& workers, MemoryBudget& budget,
            const CancelToken& cancel);

  std::span<const SlabPiece> pieces() const { return pieces_; }
  size_t ranges() const { return range_count_; }
  unsigned range_bits() const { return range_bits_; }
  SlabBound bound(size_t range, size_t piece) const {
    return bounds_[range * pieces_.size() + piece];
  }
  const uint64_t* hashes() const { return memory_.hashes_.data(); }
  const uint8_t* masks() const { return memory_.masks_.data(); }
  const uint32_t* words() const { return memory_.words_.data(); }
  uint32_t* positions() { return memory_.positions_.data(); }

 private:
  class Loader;

  // The first hash of a range; ranges() is one past the last.
  uint64_t first_hash(size_t range) const {
    return range == 0 ? interval_.first : ((interval_.first >> range_bits_) + range) << range_bits_;
  }

  std::span<const LevelRun* const> runs_;
  std::vector<SlabPiece> pieces_;
  HashInterval interval_;
  unsigned range_bits_ = 0;
  size_t range_count_ = 0;
  SlabMemory& memory_;
  PageBuffer<SlabBound> bounds_;
};

}  // namespace voxdag
