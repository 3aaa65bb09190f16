// Encodes and decodes the blocks of tiles of a package (docs/format.md, "Blocks of tiles"). A tile
// has the words of encode_tile(), except that the address of a cut-off node is the number of the
// tile that begins there (tile_numbers.h), not its word offset.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "query/package/package_index.h"

namespace voxdag::query {

// Returns the index of the first leaf in the words of a tile.
inline size_t leaves_begin(const std::vector<uint32_t>& tile) { return 4 + size_t{tile[2]}; }
inline bool has_bricks(const std::vector<uint32_t>& tile) { return tile[1] >> 16 & 1; }

class TileBlockEncoder {
 public:
  // `next` is the smallest tile number to which no earlier block of the band refers. Tile numbers
  // follow the order of the first references to the tiles, so the first new reference in the block
  // has this number.
  explicit TileBlockEncoder(uint32_t next) : first_(next), next_(next) {}
  // Adds a tile of at most kPackageTileLevels levels. All tiles of a block must have the same
  // number of levels and the same kind of leaves.
  void add(const std::vector<uint32_t>& tile);
  // Returns the bytes of the block before compression.
  std::string finish() const;

 private:
  void add_leaf(const std::vector<uint32_t>& tile, size_t leaf);

  uint32_t first_, next_;
  std::array<std::string, kPackageTileLevels> masks_;  // child masks, by level of the tile
  std::string leaves_;                                 // the masks of all leaves
  size_t leaf_count_ = 0;
  bool has_references_ = false;
  std::string is_old_;  // one bit per leaf: 1 if an earlier leaf of the band has the same number
  std::string old_;     // the numbers of the leaves with a 1 in is_old_
};

// The tiles of a block.
struct TileBlock {
  uint32_t first = 0;  // smallest tile number to which no leaf before the block refers
  uint32_t next = 0;   // the same for the leaves up to the end of the block
  std::vector<std::vector<uint32_t>> tiles;
};

// Decodes a block of `count` tiles whose roots are on `level`, in a grid of `grid_levels` levels.
// Throws Error{kCorrupt} for bytes that TileBlockEncoder cannot have returned.
TileBlock decode_tile_block(std::string_view bytes, uint32_t grid_levels, uint32_t level,
                            uint32_t count);

}  // namespace voxdag::query
