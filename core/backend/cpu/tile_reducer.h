// From the bricks of a tile to one node, level by level. All nodes of a level are hashed, then
// their slots and records fetched ahead, then looked up, so that waits for memory overlap.
//
// Which cubes of a level exist is a bit set in Morton order: its bytes are the child masks of the
// nodes above, and which bytes are not 0 is the bit set of the next level.
#pragma once

#include <cstdint>

#include "core/backend/cpu/kernels.h"
#include "core/backend/cpu/sub_dag_tables.h"
#include "core/backend/cpu/tile_bricks.h"

namespace voxdag::cpu {

class TileReducer {
 public:
  TileReducer(SubDagTables& tables, const Kernels& kernels) : tables_(tables), kernels_(kernels) {}

  // The node of a tile of 2^size_log2 voxels; its octree nodes and voxels are added to the tables'
  // counts. Leaves the tile empty.
  NodeRef reduce_bricks(TileBricks& tile, int size_log2);

  // The same for a cube whose nodes of 2^from_log2 voxels are known: those whose bits are set in
  // `existing`, in Morton order; next(m) gives the id and hash of the m-th. They are counted
  // already.
  template <class Next>
  NodeRef reduce_nodes(const uint64_t* existing, int from_log2, int size_log2, Next next) {
    const int words = words_of(size_log2 - from_log2);
    int count = 0;
    for (int w = 0; w < words; ++w) {
      existing_[w] = existing[w];
      for (uint64_t rest = existing[w]; rest != 0; rest &= rest - 1) {
        const auto& node = next(64 * w + lowest_bit(rest));
        ids_[count] = node.id;
        hashes_[count++] = node.hash;
      }
    }
    return reduce(words, count, from_log2, size_log2);
  }

 private:
  // Words of the bit set of all cubes `levels` levels below one.
  static int words_of(int levels) { return levels > 2 ? 1 << (3 * levels - 6) : 1; }
  NodeRef reduce(int words, int count, int from_log2, int size_log2);
  int reduce_level(int words, NodeTable& table);

  static constexpr int kMostNodes = kTileBricks / 8;

  SubDagTables& tables_;
  const Kernels& kernels_;
  // The current level: which cubes exist, and their ids and hashes, one after the other.
  uint64_t existing_[kTileBricks / 64];
  uint32_t ids_[kTileBricks];
  uint64_t hashes_[kTileBricks];
  uint64_t masks_[kTileBricks];  // of bricks
  // The nodes above while they are looked up.
  uint16_t first_child_[kMostNodes];
  uint8_t child_masks_[kMostNodes];
};

}  // namespace voxdag::cpu
