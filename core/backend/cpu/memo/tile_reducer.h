// Reduces the bricks of a tile to one node, level by level. Voxel blocks that occurred before are
// found in the block memo. The other nodes of a level are processed in three steps: all nodes are
// hashed, then their slots and records in the tables are prefetched, and then the tables are
// searched for all nodes. So the memory latencies of the nodes overlap.
//
// The set of the non-empty cubes of a level is stored as bits, in Morton order. Each byte of this
// set is the child mask of one node of the next coarser level. A bit of the coarser level's set is
// 1 if this byte is not 0. Not thread-safe.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/block_memo.h"
#include "core/backend/cpu/memo/full_nodes.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/base/popcount8.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class TileReducer {
 public:
  TileReducer(SubDagTables& tables, FullNodes& full, const Kernels& kernels)
      : tables_(tables), full_(full), kernels_(kernels), memo_(tables.memory()) {}

  // Returns the node of a tile with an edge of 2^size_log2 voxels, or a NodeRef without a node if
  // the tile has no voxels. Adds the tile's octree nodes and voxels to the tables' counts, and
  // empties the tile. `full` is a bit set, in Morton order, of the voxel blocks that are full
  // because they are inside a solid. These blocks are empty in `tile`. `full` is null if there are
  // no such blocks.
  NodeRef reduce_bricks(TileBricks& tile, int size_log2, const uint64_t* full = nullptr);

  // Returns the node of a cube with an edge of 2^size_log2 voxels, from its nodes with an edge of
  // 2^from_log2 voxels. Bit m of `existing` is set if the m-th cube of this smaller size, in Morton
  // order, has a node; next(m) returns that node's id and hash. Adds only the nodes above the
  // smaller cubes to the tables' counts.
  template <class Next>
  NodeRef reduce_nodes(const uint64_t* existing, int from_log2, int size_log2, Next next) {
    const int words = words_of(size_log2 - from_log2);
    int count = 0;
    for (int w = 0; w < words; ++w) {
      existing_.words[w] = existing[w];
      for (uint64_t rest = existing[w]; rest != 0; rest &= rest - 1) {
        const auto node = next(64 * w + lowest_bit(rest));
        ids_[count] = node.id;
        hashes_[count++] = node.hash;
      }
    }
    return reduce(words, count, from_log2, size_log2);
  }

 private:
  // A group of nodes that look_up() processes together: their child masks, and the position of each
  // node's first child in the list of all children of the group.
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

  // Returns the number of words in a bit set of all cubes that are `levels` levels below a cube.
  static int words_of(int levels) { return levels > 2 ? 1 << (3 * levels - 6) : 1; }
  // Sets the first `count` elements of ids_ and hashes_ to the nodes of the voxel blocks in
  // blocks_, and clears these blocks in the tile.
  void find_blocks(TileBricks& tile, int count);
  void find_new_blocks(TileBricks& tile, int count, bool insert);
  // Inserts the nodes of full voxel blocks into ids_ and hashes_, which have `count` nodes of voxel
  // blocks. `full` is as for reduce_bricks() and has `words` words. Returns the new number of
  // nodes.
  int add_full_blocks(const uint64_t* full, int words, int count);
  NodeRef reduce(int words, int count, int from_log2, int size_log2);
  // Finds or adds the nodes of `parents`. `hashes` and `ids` contain the children's values before
  // the call and the parents' values after it.
  static void look_up(const Parents& parents, NodeTable& table, uint64_t* hashes, uint32_t* ids);

  static constexpr int kMaxBricks = kTileBlocks * kBlockBricks;
  // Max children of a node. NodeTable::find_or_add() always reads this many ids, beginning with the
  // id of a node's first child. So the arrays of ids have this many spare elements at their ends.
  static constexpr int kChildren = 8;

  SubDagTables& tables_;
  FullNodes& full_;
  const Kernels& kernels_;
  BlockMemo memo_;
  // The current level: the bit set of its non-empty cubes, and the ids and hashes of their nodes,
  // in the order of the bits.
  union {
    uint64_t words[kTileBlocks / 64];
    uint8_t bytes[kTileBlocks / 8];
  } existing_;
  uint32_t ids_[kTileBlocks + kChildren] = {};
  uint64_t hashes_[kTileBlocks];
  Parents parents_;  // nodes of the next coarser level
  // blocks_ and keys_: the non-empty voxel blocks of the tile, as indexes in TileBricks::blocks,
  // and their keys. new_blocks_ and new_voxels_: the blocks that were not in the memo, as positions
  // in blocks_, and their voxel counts.
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
