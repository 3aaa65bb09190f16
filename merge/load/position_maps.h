// The positions of a level's rows in the merged level: one map, row -> position, for every run.
//
// Parents refer to positions. Positions increase with the row (only equal rows of the top tree have
// equal positions). So a run is still in the total order after its children are replaced by their
// positions. A position is one word, or two in wide maps (put_position()). The maps of all runs are
// stored one after the other. They are in memory if they fit a limit, and otherwise in a scratch
// file. One run's map, or a part of it, is loaded from this file on demand.
//
// Several threads may store different rows concurrently. Call load() only after the last store().
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/scratch_file.h"

namespace voxdag {

class PositionMaps {
 public:
  // Creates one map for each run. `rows` has the number of rows of each run. The maps are in memory
  // if all of them together take at most `resident_bytes`.
  PositionMaps(std::span<const uint64_t> rows, bool wide, uint64_t resident_bytes,
               ScratchFolder& scratch, MemoryBudget& budget);
  // Opens the maps that an earlier merge left in `file`. They are wide if the file has two words
  // per row. Reads them into memory if they take at most `resident_bytes`.
  PositionMaps(std::span<const uint64_t> rows, std::unique_ptr<ScratchFile> file,
               uint64_t resident_bytes, MemoryBudget& budget);

  // True if the maps are in memory.
  bool is_resident() const { return file_ == nullptr; }
  bool wide() const { return wide_; }
  // Returns the number of words per position.
  uint32_t position_words() const { return wide_ ? 2 : 1; }
  uint64_t rows(size_t run) const { return first_[run + 1] - first_[run]; }
  std::vector<uint64_t> rows() const;
  // Returns the number of rows of the longest map.
  uint64_t max_rows() const;
  // Returns the words of the run's whole map, for reading or storing positions. Requires
  // is_resident().
  uint32_t* words(size_t run) { return words_.data() + first_word(run); }
  const uint32_t* words(size_t run) const { return words_.data() + first_word(run); }

  // Stores the positions of rows, starting at row `first`; `words` are the positions' words.
  void store(size_t run, uint64_t first, std::span<const uint32_t> words);
  void load(size_t run, uint64_t first, std::span<uint32_t> words) const;
  uint64_t at(size_t run, uint64_t row) const;

  // Returns a file with all maps: the file that they are in, or, if they are in memory, a new file
  // to which they are copied.
  std::shared_ptr<ScratchFile> file(ScratchFolder& scratch) const;

 private:
  uint64_t first_word(size_t run) const { return first_[run] << wide_; }
  uint64_t total_words() const { return first_.back() << wide_; }

  std::vector<uint64_t> first_;  // by run: number of rows in all runs before it; then the total
  bool wide_;
  PageBuffer<uint32_t> words_;
  std::shared_ptr<ScratchFile> file_;
};

}  // namespace voxdag
