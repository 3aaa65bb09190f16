// Tiles: a tile is a node of a finished DAG with a few levels below it, for viewers that fetch only
// visible data (docs/format.md, "Tiles"). A tile is addressed by its root node, so equal subtrees
// are one tile, wherever they occur. A tile that ends above the bricks has two things for each node
// of its last level: the node's offset, which is the address of a further tile, and a coarse brick,
// which the viewer draws until that tile arrives.
//
// Stateless; thread-safe. Offsets can come from unknown clients and damaged files. So each offset
// is checked, and the tile's number of levels bounds the work for the tile.
#pragma once

#include <cstdint>
#include <vector>

#include "core/format/global/checked_blocks.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {

// Maximum number of levels of nodes in a tile. With 5 levels, a tile has at most 700 KiB.
inline constexpr uint32_t kMaxTileLevels = 5;
// The first word of a tile: "VDT1".
inline constexpr uint32_t kTileMagic = 0x31544456;

struct TileAddress {
  uint32_t level = 0;
  uint64_t offset = 0;  // word offset of the node in this level
};

// Returns the level at which a tile ends if its root is at `level`, which must be above the bricks.
// It is the first level below the root whose distance to the level of the bricks is a multiple of
// `tile_levels`.
uint32_t tile_end(uint32_t grid_levels, uint32_t tile_levels, uint32_t level);

// Returns the words of the tile. `tile_levels` is 1 to kMaxTileLevels. Throws Error{kNotFound} for
// an address that cannot have a node. Throws Error{kCorrupt} if the words at the address do not
// lead to nodes or bricks, because the address is inside a node or the file is damaged. If `blocks`
// is given, damage is reported as DamagedBlock instead, and is found even if the damaged words look
// like nodes.
std::vector<uint32_t> encode_tile(const DagView& dag, uint32_t tile_levels, const TileAddress& root,
                                  const CheckedBlocks* blocks = nullptr);

}  // namespace voxdag::query
