// Implements the kernels of solids (find_components, flood and add_slices in kernels.h). The eight
// words of Slices (slices.h) are one vector; compilers translate operations on vectors to the
// instruction set of the source that includes this header. All functions have internal linkage and
// are inlined, so each instruction set has its own code.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/slices.h"
#include "core/backend/cpu/raster/voxel_block.h"

#define VOXDAG_SLICES_INLINE [[gnu::always_inline]] static inline

namespace voxdag::cpu {

namespace slices {

constexpr uint64_t kLowZ = 0x0101010101010101ull;  // voxels with z = 0

using Words = uint64_t __attribute__((vector_size(64)));

VOXDAG_SLICES_INLINE bool is_zero(const Words& words) {
  uint64_t any = 0;
  for (int i = 0; i < 8; ++i) any |= words[i];
  return any == 0;
}

// Exchanges bits within pairs of an upper and a lower lane: the upper lane's bits `low` and the
// lower lane's bits `low` << `shift` change places. `swapped` is `words` with the lanes of each
// pair exchanged. `upper` has all ones in the upper lanes.
VOXDAG_SLICES_INLINE void exchange_lanes(Words& words, const Words& swapped, const Words& upper,
                                         int shift, uint64_t low) {
  const Words to_upper = (words & ~low) | ((swapped >> shift) & low);
  const Words to_lower = (words & ~(low << shift)) | ((swapped & low) << shift);
  words = (to_upper & upper) | (to_lower & ~upper);
}

// Converts voxels from Morton order to slices, or from slices to Morton order. A voxel's number
// (word | bit) has the bits x2 y2 z2 | x1 y1 z1 x0 y0 z0 in Morton order, and x2 x1 x0 | y2 y1 y0
// z2 z1 z0 in slices. Three exchanges of two bits each turn one order into the other, so the
// function is its own inverse.
VOXDAG_SLICES_INLINE void exchange_order(Words& words) {
  constexpr uint64_t k1 = ~uint64_t{0};
  // The exchanged bits are y2 and x1, then z2 and x0, then z1 and y0.
  exchange_lanes(words, __builtin_shufflevector(words, words, 2, 3, 0, 1, 6, 7, 4, 5),
                 Words{0, 0, k1, k1, 0, 0, k1, k1}, 32, 0x00000000ffffffffull);
  exchange_lanes(words, __builtin_shufflevector(words, words, 1, 0, 3, 2, 5, 4, 7, 6),
                 Words{0, k1, 0, k1, 0, k1, 0, k1}, 4, 0x0f0f0f0f0f0f0f0full);
  const Words differ = ((words >> 6) ^ words) & 0x00cc00cc00cc00ccull;
  words ^= differ ^ (differ << 6);
}

// Extends `reached` in both directions along lines of eight voxels, whose bits are kStep apart.
// `empty_above` has the empty voxels that a step to a higher bit can enter. `empty_below` has the
// empty voxels that a step to a lower bit can enter.
template <int kStep>
VOXDAG_SLICES_INLINE void fill_lines(Words& reached, const Words& empty_above,
                                     const Words& empty_below) {
  Words up = reached, down = reached, up_free = empty_above, down_free = empty_below;
  for (int step = kStep; step < 8 * kStep; step *= 2) {
    up |= up_free & (up << step);
    up_free &= up_free << step;
    down |= down_free & (down >> step);
    down_free &= down_free >> step;
  }
  reached = up | down;
}

// Extends `reached` through empty voxels in both directions along x, from lane to lane.
VOXDAG_SLICES_INLINE void fill_lanes(Words& reached, const Words& empty) {
  constexpr Words k0{};
  Words up = reached, down = reached, up_free = empty, down_free = empty;
  up |= up_free & __builtin_shufflevector(up, k0, 8, 0, 1, 2, 3, 4, 5, 6);
  up_free &= __builtin_shufflevector(up_free, k0, 8, 0, 1, 2, 3, 4, 5, 6);
  up |= up_free & __builtin_shufflevector(up, k0, 8, 8, 0, 1, 2, 3, 4, 5);
  up_free &= __builtin_shufflevector(up_free, k0, 8, 8, 0, 1, 2, 3, 4, 5);
  up |= up_free & __builtin_shufflevector(up, k0, 8, 8, 8, 8, 0, 1, 2, 3);
  down |= down_free & __builtin_shufflevector(down, k0, 1, 2, 3, 4, 5, 6, 7, 8);
  down_free &= __builtin_shufflevector(down_free, k0, 1, 2, 3, 4, 5, 6, 7, 8);
  down |= down_free & __builtin_shufflevector(down, k0, 2, 3, 4, 5, 6, 7, 8, 8);
  down_free &= __builtin_shufflevector(down_free, k0, 2, 3, 4, 5, 6, 7, 8, 8);
  down |= down_free & __builtin_shufflevector(down, k0, 4, 5, 6, 7, 8, 8, 8, 8);
  reached = up | down;
}

// Extends `reached` through empty voxels, once along each of the three axes.
VOXDAG_SLICES_INLINE void grow(Words& reached, const Words& empty) {
  fill_lines<1>(reached, empty & ~kLowZ, empty & ~(kLowZ << 7));
  fill_lines<8>(reached, empty, empty);
  fill_lanes(reached, empty);
}

// True if a voxel of `a` shares a face with a voxel of `b`.
VOXDAG_SLICES_INLINE bool touch(const Words& a, const Words& b) {
  Words both = (a & (b << 8)) | (b & (a << 8));
  both |= ((a & (b << 1)) | (b & (a << 1))) & ~kLowZ;
  both |= a & __builtin_shufflevector(b, Words{}, 8, 0, 1, 2, 3, 4, 5, 6);
  both |= b & __builtin_shufflevector(a, Words{}, 8, 0, 1, 2, 3, 4, 5, 6);
  return !is_zero(both);
}

VOXDAG_SLICES_INLINE void flood(const Words& empty, Words& reached) {
  do {
    grow(reached, empty);
  } while (touch(reached, empty ^ reached));
}

// Returns a bit set, by child index, of a block's corner voxels that are in `voxels`. The block has
// an edge of kLast + 1 voxels.
template <int kLast>
VOXDAG_SLICES_INLINE uint32_t corners_in(const Words& voxels) {
  uint64_t corners = 0;
  for (int c = 0; c < 8; ++c)
    corners |= (voxels[(c >> 2) * kLast] >> kLast * (8 * (c >> 1 & 1) + (c & 1)) & 1) << c;
  return static_cast<uint32_t>(corners);
}
// Sets `voxels` to the corner voxels in `corners`, which is a bit set as corners_in() returns it.
template <int kLast>
VOXDAG_SLICES_INLINE void set_corners(uint64_t corners, Words& voxels) {
  uint64_t words[2] = {0, 0};
  for (int c = 0; c < 8; ++c)
    words[c >> 2] |= (corners >> c & 1) << kLast * (8 * (c >> 1 & 1) + (c & 1));
  voxels = Words{words[0], 0, 0, kLast == 3 ? words[1] : 0, 0, 0, 0, kLast == 7 ? words[1] : 0};
}

}  // namespace slices

// Does the work of Kernels::find_components, in a block with an edge of kLast + 1 voxels.
template <int kLast>
VOXDAG_SLICES_INLINE void find_components_with(const VoxelBlock& block, const int32_t (&classes)[8],
                                               BlockComponents& out) {
  slices::Words empty;
  __builtin_memcpy(&empty, block.bricks, sizeof empty);
  slices::exchange_order(empty);
  empty = ~empty;
  if (kLast == 3)
    empty &= slices::Words{0x0f0f0f0f, 0x0f0f0f0f, 0x0f0f0f0f, 0x0f0f0f0f, 0, 0, 0, 0};
  out.count = 0;
  for (uint32_t left = slices::corners_in<kLast>(empty); left != 0;) {
    const int first = __builtin_ctz(left);
    uint32_t from = 0;
    for (int c = 0; c < 8; ++c) from |= (classes[c] == classes[first] ? 1u : 0u) << c;
    from &= left;
    slices::Words reached;
    slices::set_corners<kLast>(from, reached);
    slices::flood(empty, reached);
    uint32_t corners = slices::corners_in<kLast>(reached);
    out.is_alike[out.count] = corners == from;
    if (corners != from) {
      slices::set_corners<kLast>(1u << first, reached);
      slices::flood(empty, reached);
      corners = slices::corners_in<kLast>(reached);
    }
    __builtin_memcpy(out.voxels[out.count].x, &reached, sizeof reached);
    out.corners[out.count++] = corners;
    left &= ~corners;
    empty ^= reached;
  }
  __builtin_memcpy(out.rest.x, &empty, sizeof empty);
}

// Does the work of Kernels::flood.
VOXDAG_SLICES_INLINE void flood_with(const Slices& empty_in, Slices& reached_in) {
  slices::Words empty, reached;
  __builtin_memcpy(&empty, empty_in.x, sizeof empty);
  __builtin_memcpy(&reached, reached_in.x, sizeof reached);
  slices::flood(empty, reached);
  __builtin_memcpy(reached_in.x, &reached, sizeof reached);
}

// Does the work of Kernels::add_slices.
VOXDAG_SLICES_INLINE uint32_t add_slices_with(const Slices& voxels, VoxelBlock& block) {
  slices::Words added;
  __builtin_memcpy(&added, voxels.x, sizeof added);
  slices::exchange_order(added);
  int count = 0;
  for (int i = 0; i < 8; ++i) {
    count += __builtin_popcountll(added[i]);
    block.bricks[i] |= added[i];
  }
  return static_cast<uint32_t>(count);
}

#undef VOXDAG_SLICES_INLINE

}  // namespace voxdag::cpu
