// A voxel block: a cube of 8^3 voxels, eight bricks in a cache line.
#pragma once

#include <cstdint>

namespace voxdag::cpu {

inline constexpr int kBlockLog2 = 3;
inline constexpr int kBlockBricks = 8;

// Brick masks in Morton order.
struct alignas(64) VoxelBlock {
  uint64_t bricks[kBlockBricks];
};

// Constants of block_key(), the hash of voxel blocks (hash family NH of Black et al., "UMAC",
// 1999). block_key() adds a constant to each 32-bit half of a brick, multiplies the two halves, and
// sums the products. With vector instructions, this takes no longer than loading the bricks.
struct BlockKeys {
  alignas(64) uint64_t add[kBlockBricks] = {};
  constexpr BlockKeys() {
    uint64_t x = 0x9e3779b97f4a7c15ull;
    for (uint64_t& a : add) a = x = (x ^ x >> 29) * 0xd6e8feb86659fd93ull;
  }
};
inline constexpr BlockKeys kBlockKeys;

inline uint64_t block_key(const VoxelBlock& block) {
  uint64_t key = 0;
  for (int i = 0; i < kBlockBricks; ++i) {
    const uint64_t brick = block.bricks[i], add = kBlockKeys.add[i];
    key += uint64_t{static_cast<uint32_t>(brick) + static_cast<uint32_t>(add)} *
           (static_cast<uint32_t>(brick >> 32) + static_cast<uint32_t>(add >> 32));
  }
  return key;
}

}  // namespace voxdag::cpu
