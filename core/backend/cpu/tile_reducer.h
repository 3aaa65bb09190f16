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

  // The same for a tile whose nodes of 2^from_log2 voxels are known: those whose bit in `existing`
  // is set are refs[0], refs[1], ... in Morton order; they are counted already.
  template <class Refs>
  NodeRef reduce_nodes(const uint64_t* existing, int words, const Refs& refs, int from_log2,
                       int size_log2) {
    int count = 0;
    for (int w = 0; w < words; ++w) {
      existing_[w] = existing[w];
      count += popcount64(existing[w]);
    }
    for (int i = 0; i < count; ++i) {
      ids_[i] = refs[i].id;
      hashes_[i] = refs[i].hash;
    }
    return reduce(words, count, from_log2, size_log2);
  }

 private:
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
