// Blocks of tiles in a package (docs/format.md, "Blocks of tiles"). The tiles have the words of
// encode_tile(), except that the address of a cut-off node has the node's number in its band
// instead of a word offset.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "query/package/package_index.h"

namespace voxdag::query {

// Index of the first leaf's words in a tile.
inline size_t leaves_begin(const std::vector<uint32_t>& tile) { return 4 + size_t{tile[2]}; }
inline bool has_bricks(const std::vector<uint32_t>& tile) { return tile[1] >> 16 & 1; }

class TileBlockEncoder {
 public:
  // `next` is the first number that no earlier block of the band refers to. Numbers are given in
  // the order of the first references to them.
  explicit TileBlockEncoder(uint32_t next) : first_(next), next_(next) {}
  // Adds a tile of at most kPackageTileLevels levels. All tiles of a block have the same shape.
  void add(const std::vector<uint32_t>& tile);
  // Returns the bytes of the block, not compressed.
  std::string finish() const;

 private:
  void add_leaf(const std::vector<uint32_t>& tile, size_t leaf);

  uint32_t first_, next_;
  std::array<std::string, kPackageTileLevels> masks_;  // by level
  std::array<std::string, 8> bricks_;                  // by byte of the mask
  bool has_references_ = false;
  size_t leaves_ = 0;
  std::string is_old_;              // one bit per leaf: a number that was referred to before
  std::array<std::string, 4> old_;  // by byte of the distance to the next number
};

// The tiles of a block.
struct TileBlock {
  uint32_t first = 0;  // the next number before the block
  uint32_t next = 0;   // the next number after the block
  std::vector<std::vector<uint32_t>> tiles;
};

// Decodes a block of `count` tiles whose roots are on `level`, in a grid of `grid_levels` levels.
// Throws Error{kCorrupt} for bytes that TileBlockEncoder cannot have written.
TileBlock decode_tile_block(std::string_view bytes, uint32_t grid_levels, uint32_t level,
                            uint32_t count);

}  // namespace voxdag::query
