// The 6-connected components of the empty voxels of a voxel block, found with bit operations.
//
// Slices store a block's 512 voxels in eight words: voxel (x, y, z) is bit 8 y + z of word x. A
// step along z or y is then a shift within a word, and a step along x is a step to the next word.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/voxel_block.h"

namespace voxdag::cpu {

struct Slices {
  uint64_t x[8] = {};

  bool any() const {
    uint64_t bits = 0;
    for (const uint64_t word : x) bits |= word;
    return bits != 0;
  }
  bool operator==(const Slices&) const = default;
};

// Reorder the voxels of a block, from Morton order to slices and back.
Slices slices_of(const VoxelBlock& block);
VoxelBlock block_of(const Slices& slices);

// Returns the voxels of `empty` that walks of 6-neighbors through `empty` reach from `seeds`, which
// must be in `empty`.
Slices flood(const Slices& seeds, const Slices& empty);

}  // namespace voxdag::cpu
