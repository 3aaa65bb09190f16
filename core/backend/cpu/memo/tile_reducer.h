// Reduces the bricks of a tile to one node, level by level. Voxel blocks that occurred before are
// found in the block memo. The other nodes of a level are processed in three steps, so that memory
// latencies overlap: all are hashed, then their slots and records are prefetched, and then all are
// looked up.
//
// The non-empty cubes of a level are a bit set in Morton order. Each byte of this set is the child
// mask of a node of the next coarser level, and the positions of the nonzero bytes are the bit set
// of that level. Not thread-safe.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/block_memo.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/base/popcount8.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class TileReducer {
 public:
  TileReducer(SubDagTables& tables, const Kernels& kernels)
      : tables_(tables), kernels_(kernels), memo_(tables.memory()) {}

  // Returns the node of a tile of 2^size_log2 voxels, adds the tile's octree nodes and voxels to
  // the tables' counts, and empties the tile.
  NodeRef reduce_bricks(TileBricks& tile, int size_log2);

  // Returns the node of a cube, given its nodes of 2^from_log2 voxels. The bits set in `existing`
  // are these nodes' cubes, in Morton order. next(m) returns the id and hash of the m-th node,
  // which is already counted.
  template <class Next>
  NodeRef reduce_nodes(const uint64_t* existing, int from_log2, int size_log2, Next next) {
    const int words = words_of(size_log2 - from_log2);
    int count = 0;
    for (int w = 0; w < words; ++w) {
      existing_.words[w] = existing[w];
      for (uint64_t rest = existing[w]; rest != 0; rest &= rest - 1) {
        const auto& node = next(64 * w + lowest_bit(rest));
        ids_[count] = node.id;
        hashes_[count++] = node.hash;
      }
    }
    return reduce(words, count, from_log2, size_log2);
  }

 private:
  // A group of nodes for one batch of lookups: child masks, and the position of their first child
  // in a list.
  struct Parents {
    int count = 0, children = 0;
    uint16_t first_child[kTileBlocks];
    uint8_t masks[kTileBlocks];

    void add(uint32_t mask) {
      masks[count] = static_cast<uint8_t>(mask);
      first_child[count++] = static_cast<uint16_t>(children);
      children += popcount8(mask);
    }
  };

  // Number of words in the bit set of all cubes `levels` levels below a cube.
  static int words_of(int levels) { return levels > 2 ? 1 << (3 * levels - 6) : 1; }
  // Finds ids and hashes of the listed voxel blocks, and clears the blocks in the tile.
  void find_blocks(TileBricks& tile, int count);
  void find_new_blocks(TileBricks& tile, int count, bool insert);
  NodeRef reduce(int words, int count, int from_log2, int size_log2);
  // Overwrites the children's hashes and ids with the parents'.
  static void look_up(const Parents& parents, NodeTable& table, uint64_t* hashes, uint32_t* ids);

  static constexpr int kMaxBricks = kTileBlocks * kBlockBricks;
  // Words that must be readable after the first child of any node.
  static constexpr int kChildren = 8;

  SubDagTables& tables_;
  const Kernels& kernels_;
  BlockMemo memo_;
  // The current level: the set of non-empty cubes, and their ids and hashes in this order.
  union {
    uint64_t words[kTileBlocks / 64];
    uint8_t bytes[kTileBlocks / 8];
  } existing_;
  uint32_t ids_[kTileBlocks + kChildren] = {};
  uint64_t hashes_[kTileBlocks];
  Parents parents_;  // nodes of the level above
  // Voxel blocks of a tile: their numbers, their keys, and the positions of new blocks in this
  // list.
  uint16_t blocks_[kTileBlocks + 1];
  uint64_t keys_[kTileBlocks + 1];
  uint16_t new_blocks_[kTileBlocks];
  uint16_t new_voxels_[kTileBlocks];
  // Bricks of the new voxel blocks.
  uint64_t bricks_[kMaxBricks];
  uint64_t brick_hashes_[kMaxBricks];
  uint32_t brick_ids_[kMaxBricks + kChildren] = {};
};

}  // namespace voxdag::cpu
