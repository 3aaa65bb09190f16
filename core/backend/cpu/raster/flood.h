// Implements the kernels of solids (find_components, flood and add_slices in kernels.h). Compilers
// translate operations on vectors (words.h) to the instruction set of the source that includes this
// header.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/slices.h"
#include "core/backend/cpu/raster/voxel_block.h"
#include "core/backend/cpu/raster/words.h"

namespace voxdag::cpu {

namespace slices {

constexpr uint64_t kLowZ = 0x0101010101010101ull;  // voxels with z = 0

// For each pair of an upper and a lower lane, exchanges the bits `low` of the upper lane with the
// bits `low` << `shift` of the lower lane. `swapped` is `words` with the lanes of each pair
// exchanged. `upper` has all ones in the upper lanes.
VOXDAG_SLICES_INLINE Words exchange_lanes(const Words& words, const Words& swapped,
                                          const Words& upper, int shift, uint64_t low) {
  const Words to_upper = (words & ~low) | ((swapped >> shift) & low);
  const Words to_lower = (words & ~(low << shift)) | ((swapped & low) << shift);
  return (to_upper & upper) | (to_lower & ~upper);
}

// Converts voxels from Morton order to slices, or from slices to Morton order. A voxel's number
// (word | bit) has the bits x2 y2 z2 | x1 y1 z1 x0 y0 z0 in Morton order, and x2 x1 x0 | y2 y1 y0
// z2 z1 z0 in slices. Three exchanges of two bits each turn one order into the other, so the
// function is its own inverse.
VOXDAG_SLICES_INLINE Words exchange_order(const Words& in) {
  constexpr uint64_t k1 = ~uint64_t{0};
  constexpr uint64_t kUpper[2][8] = {{0, 0, k1, k1, 0, 0, k1, k1}, {0, k1, 0, k1, 0, k1, 0, k1}};
  Words upper[2];
  __builtin_memcpy(upper, kUpper, sizeof upper);
  // The exchanged bits are y2 and x1, then z2 and x0, then z1 and y0.
  Words words = exchange_lanes(in, swap_two(in), upper[0], 32, 0x00000000ffffffffull);
  words = exchange_lanes(words, swap_one(words), upper[1], 4, 0x0f0f0f0f0f0f0f0full);
  const Words differ = ((words >> 6) ^ words) & 0x00cc00cc00cc00ccull;
  return words ^ differ ^ (differ << 6);
}

// Extends `reached` in both directions along lines of eight voxels, whose bits are kStep apart.
// `empty_above` has the empty voxels that a step to a higher bit can enter. `empty_below` has the
// empty voxels that a step to a lower bit can enter.
template <int kStep>
VOXDAG_SLICES_INLINE Words fill_lines(const Words& reached, const Words& empty_above,
                                      const Words& empty_below) {
  Words up = reached, down = reached, up_free = empty_above, down_free = empty_below;
  for (int step = kStep; step < 8 * kStep; step *= 2) {
    up = up | (up_free & (up << step));
    up_free = up_free & (up_free << step);
    down = down | (down_free & (down >> step));
    down_free = down_free & (down_free >> step);
  }
  return up | down;
}

// Extends `reached` through empty voxels in both directions along x, from lane to lane.
VOXDAG_SLICES_INLINE Words fill_lanes(const Words& reached, const Words& empty) {
  Words up = reached, up_free = empty, down = reached, down_free = empty;
  up = up | (up_free & move_up<1>(up));
  up_free = up_free & move_up<1>(up_free);
  up = up | (up_free & move_up<2>(up));
  up_free = up_free & move_up<2>(up_free);
  up = up | (up_free & move_up<4>(up));
  down = down | (down_free & move_down<1>(down));
  down_free = down_free & move_down<1>(down_free);
  down = down | (down_free & move_down<2>(down));
  down_free = down_free & move_down<2>(down_free);
  down = down | (down_free & move_down<4>(down));
  return up | down;
}

// Extends `reached` through empty voxels, once along each of the three axes.
VOXDAG_SLICES_INLINE Words grow(const Words& reached, const Words& empty) {
  const Words along_z = fill_lines<1>(reached, empty & ~kLowZ, empty & ~(kLowZ << 7));
  return fill_lanes(fill_lines<8>(along_z, empty, empty), empty);
}

// True if a voxel of `a` shares a face with a voxel of `b`.
VOXDAG_SLICES_INLINE bool touch(const Words& a, const Words& b) {
  const Words around = move_up<1>(b) | move_down<1>(b) | (b << 8) | (b >> 8) | ((b << 1) & ~kLowZ) |
                       ((b >> 1) & ~(kLowZ << 7));
  return !is_zero(a & around);
}

VOXDAG_SLICES_INLINE Words flood(const Words& empty, const Words& from) {
  Words reached = from;
  do {
    reached = grow(reached, empty);
  } while (touch(reached, empty ^ reached));
  return reached;
}

// Returns a bit set, by child index, of a block's corner voxels that are in `voxels`. The block has
// an edge of kLast + 1 voxels.
template <int kLast>
VOXDAG_SLICES_INLINE uint32_t corners_in(const Words& voxels) {
  const uint64_t words[2] = {word(voxels, 0), word(voxels, kLast)};
  uint64_t corners = 0;
  for (int c = 0; c < 8; ++c)
    corners |= (words[c >> 2] >> kLast * (8 * (c >> 1 & 1) + (c & 1)) & 1) << c;
  return static_cast<uint32_t>(corners);
}
// Returns the corner voxels in `corners`, which is a bit set as corners_in() returns it.
template <int kLast>
VOXDAG_SLICES_INLINE Words corner_voxels(uint64_t corners) {
  uint64_t words[2] = {0, 0};
  for (int c = 0; c < 8; ++c)
    words[c >> 2] |= (corners >> c & 1) << kLast * (8 * (c >> 1 & 1) + (c & 1));
  return end_words<kLast>(words[0], words[1]);
}

}  // namespace slices

// Does the work of Kernels::find_components, in a block with an edge of kLast + 1 voxels.
template <int kLast>
VOXDAG_SLICES_INLINE void find_components_with(const VoxelBlock& block, const int32_t (&classes)[8],
                                               BlockComponents& out) {
  slices::Words empty;
  __builtin_memcpy(&empty, block.bricks, sizeof empty);
  empty = ~slices::exchange_order(empty);
  if constexpr (kLast == 3) {
    constexpr uint64_t k4 = 0x0f0f0f0f, kBlock[8] = {k4, k4, k4, k4, 0, 0, 0, 0};
    slices::Words in_block;
    __builtin_memcpy(&in_block, kBlock, sizeof in_block);
    empty = empty & in_block;
  }
  out.count = 0;
  out.empty_voxels = 0;
  for (int i = 0; i < 8; ++i) out.empty_voxels += __builtin_popcountll(slices::word(empty, i));
  for (uint32_t left = slices::corners_in<kLast>(empty); left != 0;) {
    const int first = __builtin_ctz(left);
    uint32_t from = 0;
    for (int c = 0; c < 8; ++c) from |= (classes[c] == classes[first] ? 1u : 0u) << c;
    from &= left;
    slices::Words reached = slices::flood(empty, slices::corner_voxels<kLast>(from));
    uint32_t corners = slices::corners_in<kLast>(reached);
    out.is_alike[out.count] = corners == from;
    if (corners != from && from != 1u << first) {
      reached = slices::flood(empty, slices::corner_voxels<kLast>(1u << first));
      corners = slices::corners_in<kLast>(reached);
    }
    __builtin_memcpy(out.voxels[out.count].x, &reached, sizeof reached);
    out.corners[out.count++] = corners;
    left &= ~corners;
    empty = empty ^ reached;
  }
  __builtin_memcpy(out.rest.x, &empty, sizeof empty);
}

// Does the work of Kernels::flood.
VOXDAG_SLICES_INLINE void flood_with(const Slices& empty_in, Slices& reached_in) {
  slices::Words empty, reached;
  __builtin_memcpy(&empty, empty_in.x, sizeof empty);
  __builtin_memcpy(&reached, reached_in.x, sizeof reached);
  reached = slices::flood(empty, reached);
  __builtin_memcpy(reached_in.x, &reached, sizeof reached);
}

// Does the work of Kernels::add_slices.
VOXDAG_SLICES_INLINE uint32_t add_slices_with(const Slices& voxels, VoxelBlock& block) {
  slices::Words added;
  __builtin_memcpy(&added, voxels.x, sizeof added);
  added = slices::exchange_order(added);
  int count = 0;
  for (int i = 0; i < 8; ++i) {
    count += __builtin_popcountll(slices::word(added, i));
    block.bricks[i] |= slices::word(added, i);
  }
  return static_cast<uint32_t>(count);
}

#undef VOXDAG_SLICES_INLINE

}  // namespace voxdag::cpu
