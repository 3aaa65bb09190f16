// The voxels of a block, in an order in which steps to neighbors are simple: x is the number of the
// word, and bit 8 y + z of the word belongs to y and z. A step along z or y is a shift within a
// word, and a step along x is a step to the next word.
#pragma once

#include <cstdint>

namespace voxdag::cpu {

struct Slices {
  uint64_t x[8] = {};

  bool any() const {
    uint64_t bits = 0;
    for (const uint64_t word : x) bits |= word;
    return bits != 0;
  }
  void remove(const Slices& o) {
    for (int i = 0; i < 8; ++i) x[i] &= ~o.x[i];
  }
};

// The 6-connected components of a block's empty voxels that contain a corner of the block. One
// entry can have several components. All their corners then have the same class
// (TileViews::classes_at()), so these components are all inside the solid or all outside.
struct BlockComponents {
  int count;
  uint32_t corners[8];  // corners of each entry, as a bit set by child index
  bool is_alike[8];     // all corners of the entry have the same class
  Slices voxels[8];
  Slices rest;       // empty voxels of components without a corner
  int empty_voxels;  // number of the block's empty voxels
};

}  // namespace voxdag::cpu
