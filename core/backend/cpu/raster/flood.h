// Implements the kernels of solids (find_components, flood and add_slices in kernels.h). The eight
// words of Slices (slices.h) are two vectors of four words, because AVX2 has vectors of this size.
// For larger vectors than the instruction set has, GCC compiles shuffles to slow code, which moves
// single words through memory. Compilers translate operations on vectors to the instruction set of
// the source that includes this header. All functions have internal linkage and are inlined, so
// each instruction set has its own code.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/slices.h"
#include "core/backend/cpu/raster/voxel_block.h"

#define VOXDAG_SLICES_INLINE [[gnu::always_inline]] static inline

namespace voxdag::cpu {

namespace slices {

constexpr uint64_t kLowZ = 0x0101010101010101ull;  // voxels with z = 0

using Half = uint64_t __attribute__((vector_size(32)));

struct Words {
  Half low, high;  // the words 0-3 and 4-7
};

VOXDAG_SLICES_INLINE bool is_zero(const Half& words) {
  return (words[0] | words[1] | words[2] | words[3]) == 0;
}

// For each pair of an upper and a lower lane, exchanges the bits `low` of the upper lane with the
// bits `low` << `shift` of the lower lane. `swapped` is `words` with the lanes of each pair
// exchanged. `upper` has all ones in the upper lanes.
VOXDAG_SLICES_INLINE void exchange_lanes(Half& words, const Half& swapped, const Half& upper,
                                         int shift, uint64_t low) {
  const Half to_upper = (words & ~low) | ((swapped >> shift) & low);
  const Half to_lower = (words & ~(low << shift)) | ((swapped & low) << shift);
  words = (to_upper & upper) | (to_lower & ~upper);
}

VOXDAG_SLICES_INLINE void exchange_order(Half& words) {
  constexpr uint64_t k1 = ~uint64_t{0};
  // The exchanged bits are y2 and x1, then z2 and x0, then z1 and y0.
  exchange_lanes(words, __builtin_shufflevector(words, words, 2, 3, 0, 1), Half{0, 0, k1, k1}, 32,
                 0x00000000ffffffffull);
  exchange_lanes(words, __builtin_shufflevector(words, words, 1, 0, 3, 2), Half{0, k1, 0, k1}, 4,
                 0x0f0f0f0f0f0f0f0full);
  const Half differ = ((words >> 6) ^ words) & 0x00cc00cc00cc00ccull;
  words ^= differ ^ (differ << 6);
}

// Converts voxels from Morton order to slices, or from slices to Morton order. A voxel's number
// (word | bit) has the bits x2 y2 z2 | x1 y1 z1 x0 y0 z0 in Morton order, and x2 x1 x0 | y2 y1 y0
// z2 z1 z0 in slices. Three exchanges of two bits each turn one order into the other, so the
// function is its own inverse.
VOXDAG_SLICES_INLINE void exchange_order(Words& words) {
  exchange_order(words.low);
  exchange_order(words.high);
}

// Extends `reached` in both directions along lines of eight voxels, whose bits are kStep apart.
// `empty_above` has the empty voxels that a step to a higher bit can enter. `empty_below` has the
// empty voxels that a step to a lower bit can enter.
template <int kStep>
VOXDAG_SLICES_INLINE void fill_lines(Half& reached, const Half& empty_above,
                                     const Half& empty_below) {
  Half up = reached, down = reached, up_free = empty_above, down_free = empty_below;
  for (int step = kStep; step < 8 * kStep; step *= 2) {
    up |= up_free & (up << step);
    up_free &= up_free << step;
    down |= down_free & (down >> step);
    down_free &= down_free >> step;
  }
  reached = up | down;
}

// Sets `out` to `in`, moved by `kLanes` lanes (1 or 2) to higher lanes.
template <int kLanes>
VOXDAG_SLICES_INLINE void move_up(const Words& in, Words& out) {
  constexpr Half k0{};
  if (kLanes == 1) {
    out.high = __builtin_shufflevector(in.low, in.high, 3, 4, 5, 6);
    out.low = __builtin_shufflevector(in.low, k0, 4, 0, 1, 2);
  } else {
    out.high = __builtin_shufflevector(in.low, in.high, 2, 3, 4, 5);
    out.low = __builtin_shufflevector(in.low, k0, 4, 4, 0, 1);
  }
}
// Sets `out` to `in`, moved by `kLanes` lanes (1 or 2) to lower lanes.
template <int kLanes>
VOXDAG_SLICES_INLINE void move_down(const Words& in, Words& out) {
  constexpr Half k0{};
  if (kLanes == 1) {
    out.low = __builtin_shufflevector(in.low, in.high, 1, 2, 3, 4);
    out.high = __builtin_shufflevector(in.high, k0, 1, 2, 3, 4);
  } else {
    out.low = __builtin_shufflevector(in.low, in.high, 2, 3, 4, 5);
    out.high = __builtin_shufflevector(in.high, k0, 2, 3, 4, 4);
  }
}

// Adds to `reached` the voxels of `moved` that are free.
VOXDAG_SLICES_INLINE void add_free(Words& reached, const Words& free, const Words& moved) {
  reached.low |= free.low & moved.low;
  reached.high |= free.high & moved.high;
}
// Removes from `free` the voxels that are not in `moved`.
VOXDAG_SLICES_INLINE void keep_common(Words& free, const Words& moved) {
  free.low &= moved.low;
  free.high &= moved.high;
}

// Extends `reached` through empty voxels in both directions along x, from lane to lane.
VOXDAG_SLICES_INLINE void fill_lanes(Words& reached, const Words& empty) {
  Words up = reached, up_free = empty, down = reached, down_free = empty, moved;
  move_up<1>(up, moved);
  add_free(up, up_free, moved);
  move_up<1>(up_free, moved);
  keep_common(up_free, moved);
  move_up<2>(up, moved);
  add_free(up, up_free, moved);
  move_up<2>(up_free, moved);
  up.high |= up_free.high & moved.high & up.low;
  move_down<1>(down, moved);
  add_free(down, down_free, moved);
  move_down<1>(down_free, moved);
  keep_common(down_free, moved);
  move_down<2>(down, moved);
  add_free(down, down_free, moved);
  move_down<2>(down_free, moved);
  down.low |= down_free.low & moved.low & down.high;
  reached.low = up.low | down.low;
  reached.high = up.high | down.high;
}

// Extends `reached` through empty voxels, once along each of the three axes.
VOXDAG_SLICES_INLINE void grow(Words& reached, const Words& empty) {
  for (int half = 0; half < 2; ++half) {
    Half& from = half == 0 ? reached.low : reached.high;
    const Half& within = half == 0 ? empty.low : empty.high;
    fill_lines<1>(from, within & ~kLowZ, within & ~(kLowZ << 7));
    fill_lines<8>(from, within, within);
  }
  fill_lanes(reached, empty);
}

// Adds to `touching` the voxels of `a` with a neighbor in `b` along y or z.
VOXDAG_SLICES_INLINE void add_touching(const Half& a, const Half& b, Half& touching) {
  touching |= a & ((b << 8) | (b >> 8) | ((b << 1) & ~kLowZ) | ((b >> 1) & ~(kLowZ << 7)));
}

// True if a voxel of `a` shares a face with a voxel of `b`.
VOXDAG_SLICES_INLINE bool touch(const Words& a, const Words& b) {
  Words up, down;
  move_up<1>(b, up);
  move_down<1>(b, down);
  Half touching = (a.low & (up.low | down.low)) | (a.high & (up.high | down.high));
  add_touching(a.low, b.low, touching);
  add_touching(a.high, b.high, touching);
  return !is_zero(touching);
}

VOXDAG_SLICES_INLINE void flood(const Words& empty, Words& reached) {
  Words rest;
  do {
    grow(reached, empty);
    rest.low = empty.low ^ reached.low;
    rest.high = empty.high ^ reached.high;
  } while (touch(reached, rest));
}

// Returns a bit set, by child index, of a block's corner voxels that are in `voxels`. The block has
// an edge of kLast + 1 voxels.
template <int kLast>
VOXDAG_SLICES_INLINE uint32_t corners_in(const Words& voxels) {
  const uint64_t words[2] = {voxels.low[0], kLast == 7 ? voxels.high[3] : voxels.low[3]};
  uint64_t corners = 0;
  for (int c = 0; c < 8; ++c)
    corners |= (words[c >> 2] >> kLast * (8 * (c >> 1 & 1) + (c & 1)) & 1) << c;
  return static_cast<uint32_t>(corners);
}
// Sets `voxels` to the corner voxels in `corners`, which is a bit set as corners_in() returns it.
template <int kLast>
VOXDAG_SLICES_INLINE void set_corners(uint64_t corners, Words& voxels) {
  uint64_t words[2] = {0, 0};
  for (int c = 0; c < 8; ++c)
    words[c >> 2] |= (corners >> c & 1) << kLast * (8 * (c >> 1 & 1) + (c & 1));
  voxels.low = Half{words[0], 0, 0, kLast == 3 ? words[1] : 0};
  voxels.high = Half{0, 0, 0, kLast == 7 ? words[1] : 0};
}

}  // namespace slices

// Does the work of Kernels::find_components, in a block with an edge of kLast + 1 voxels.
template <int kLast>
VOXDAG_SLICES_INLINE void find_components_with(const VoxelBlock& block, const int32_t (&classes)[8],
                                               BlockComponents& out) {
  slices::Words empty;
  __builtin_memcpy(&empty, block.bricks, sizeof empty);
  slices::exchange_order(empty);
  empty.low = ~empty.low;
  empty.high = ~empty.high;
  if (kLast == 3) {
    empty.low &= slices::Half{0x0f0f0f0f, 0x0f0f0f0f, 0x0f0f0f0f, 0x0f0f0f0f};
    empty.high = slices::Half{};
  }
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
    empty.low ^= reached.low;
    empty.high ^= reached.high;
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
  for (int i = 0; i < 4; ++i) {
    count += __builtin_popcountll(added.low[i]) + __builtin_popcountll(added.high[i]);
    block.bricks[i] |= added.low[i];
    block.bricks[4 + i] |= added.high[i];
  }
  return static_cast<uint32_t>(count);
}

#undef VOXDAG_SLICES_INLINE

}  // namespace voxdag::cpu
