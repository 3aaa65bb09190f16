// Numbers the tiles of a band (package_index.h). The tiles of the first picture (first_tiles.h) get
// the first numbers, and then all other tiles, both in the order in which a walk over the tiles of
// the band above first reaches them. So the numbers depend only on the contents of the DAG and on
// the camera of the first picture, not on the order of the nodes in the file. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "core/format/global/node_index.h"
#include "query/combine/spill/spill.h"

namespace voxdag::query {

class TileNumbers {
 public:
  // The tiles have their roots on `level`, which must be above the bricks. Throws
  // Error{kOutOfMemory} if the numbers do not fit in the budget: they need 4 bytes per node and 2
  // bits per word of the level.
  TileNumbers(const voxdag_reader::File& file, uint32_t level, unsigned threads,
              const SpillSpace& space, const CancelToken& cancel)
      : path_(file.path()),
        level_(level),
        nodes_(file.level(level),
               file.level(level + 1).pointer_bits == 64 ? Pointers::kWide : Pointers::kNarrow,
               threads, space.budget, cancel, file.path() + ": level " + std::to_string(level)),
        numbers_(space.budget, file.level(level).node_count, "the numbers of tiles"),
        offsets_(space) {
    if (file.level(level).node_count >= UINT32_MAX)
      throw Error(ErrorCode::kLimit, file.path() + ": level " + std::to_string(level) + " has " +
                                         std::to_string(file.level(level).node_count) +
                                         " nodes: expected fewer than 2^32 - 1 for a package");
  }

  // Returns the number of the tile whose root is at a word offset. On the first call for a root,
  // gives its tile the next number.
  uint32_t number(uint64_t offset) {
    const uint64_t node = nodes_.find(offset);
    if (node == NodeIndex::kNone)
      throw Error(ErrorCode::kCorrupt, path_ + ": level " + std::to_string(level_) + ", word " +
                                           std::to_string(offset) +
                                           ": no node begins here, expected one");
    uint32_t& number = numbers_[node];
    if (number == 0) {
      offsets_.add(offset);
      number = ++count_;
    }
    return number - 1;
  }
  uint32_t count() const { return count_; }
  // Returns the word offsets of the roots, in the order of the tile numbers.
  SpillList<uint64_t>& offsets() { return offsets_; }

 private:
  const std::string path_;
  const uint32_t level_;
  const NodeIndex nodes_;
  PageBuffer<uint32_t> numbers_;  // by node: 1 + number; 0 if it has no number yet
  SpillList<uint64_t> offsets_;
  uint32_t count_ = 0;
};

}  // namespace voxdag::query
