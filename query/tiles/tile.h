// Tiles: a node of a finished DAG with a few levels below it, for viewers that fetch visible data
// (docs/format.md, "Tiles"). A tile is addressed by its root, so that equal subtrees are one tile,
// wherever they occur. Where it ends in the middle of the DAG, it has for each cut-off child the
// address of that child's tile and a coarse brick to draw until the tile arrives.
//
// Stateless; thread-safe. Offsets may come from anyone and from damaged files: each is checked, and
// the work for a tile is bounded by its levels.
#pragma once

#include <cstdint>
#include <vector>

#include "core/format/global/checked_blocks.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {

// How many levels of nodes a tile may have: with 5 its size is at most 700 KiB.
inline constexpr uint32_t kMaxTileLevels = 5;
// The first word of a tile: "VDT1".
inline constexpr uint32_t kTileMagic = 0x31544456;

struct TileAddress {
  uint32_t level = 0;
  uint64_t offset = 0;  // in words, of a node in that level
};

// The level at which a tile with a root at `level`, which is above the bricks, is cut off: the next
// one below it that is a multiple of `tile_levels` above the bricks.
uint32_t tile_end(uint32_t grid_levels, uint32_t tile_levels, uint32_t level);

// The words of the tile. `tile_levels` is 1 to kMaxTileLevels. Throws Error{kNotFound} for an
// address that cannot have a node, and Error{kCorrupt} if the words there lead to no node or brick:
// the address is inside a node, or the file is damaged. With the blocks of its file, damage is
// DamagedBlock, and is found even if the words look like nodes.
std::vector<uint32_t> encode_tile(const DagView& dag, uint32_t tile_levels, const TileAddress& root,
                                  const CheckedBlocks* blocks = nullptr);

}  // namespace voxdag::query
