// The numbers of the tiles of a band. A tile's number depends only on the DAG's contents: the
// numbers follow the order in which a walk over the tiles of the band above first meets the tiles.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "core/format/global/node_index.h"
#include "query/combine/spill.h"

namespace voxdag::query {

class TileNumbers {
 public:
  // For the nodes on `level`, which is above the bricks. Throws Error{kOutOfMemory} if the numbers
  // do not fit in the budget: 4 bytes per node, and 2 bits per word of the level.
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
      throw Error(ErrorCode::kLimit, file.path() + ": level " + std::to_string(level) +
                                         " has more than 2^32 nodes: expected fewer for a package");
  }

  // Returns the number of the node at a word offset. A new node gets the next number.
  uint32_t number(uint64_t offset) {
    const uint64_t node = nodes_.find(offset);
    if (node == NodeIndex::kNone)
      throw Error(ErrorCode::kCorrupt, path_ + ": level " + std::to_string(level_) + ", word " +
                                           std::to_string(offset) + ": expected a node");
    uint32_t& number = numbers_[node];
    if (number == 0) {
      offsets_.add(offset);
      number = ++count_;
    }
    return number - 1;
  }
  uint32_t count() const { return count_; }
  // The word offsets of the nodes, in the order of their numbers.
  SpillList<uint64_t>& offsets() { return offsets_; }

 private:
  const std::string path_;
  const uint32_t level_;
  const NodeIndex nodes_;
  PageBuffer<uint32_t> numbers_;  // 1 + number; 0 for a node without number
  SpillList<uint64_t> offsets_;
  uint32_t count_ = 0;
};

}  // namespace voxdag::query
