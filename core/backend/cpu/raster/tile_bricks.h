// The bricks of one tile. A tile is a cube of at most 64^3 voxels, so that its bricks (32 KiB)
// remain in the CPU's cache while all triangles of the tile are drawn. Not thread-safe.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/voxel_block.h"

namespace voxdag::cpu {

inline constexpr int kTileLog2 = 6;  // log2 of a full tile's edge in voxels
inline constexpr int kTileBlocks = 1 << 3 * (kTileLog2 - kBlockLog2);

// kSpread[k]: a brick's coordinate k in the tile, with its bits moved to positions 0, 3, 6 and 9.
// Shifted left by 2 - a, this is axis a's part of the brick's Morton index in the tile.
inline constexpr uint32_t kSpread[16] = {
    0x000, 0x001, 0x008, 0x009, 0x040, 0x041, 0x048, 0x049,
    0x200, 0x201, 0x208, 0x209, 0x240, 0x241, 0x248, 0x249,
};

struct TileBricks {
  VoxelBlock blocks[kTileBlocks] = {};  // in Morton order
  // touched[i] is not 0 if voxel block i may have voxels.
  alignas(64) uint8_t touched[kTileBlocks] = {};

  uint64_t& brick(uint32_t index) {
    return blocks[index / kBlockBricks].bricks[index % kBlockBricks];
  }
  [[gnu::always_inline]] void add(uint32_t index, uint64_t voxels) {
    brick(index) |= voxels;
    touched[index / kBlockBricks] = 1;
  }
};

}  // namespace voxdag::cpu
