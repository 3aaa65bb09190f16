// The inner loops that exist several times, portable, for AVX2 with BMI2, and some of them for
// AVX-512 (F, BW, DQ, VL, VBMI), chosen at run time; they give the same voxels. Sources named
// *_avx2.cc and *_avx512.cc are compiled for these instruction sets, so nothing of them, inline
// functions of shared headers included, may run before the choice is made.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/voxel_block.h"
#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"
#include "core/backend/cpu/triangle_set.h"

namespace voxdag::cpu {

// Bit masks of a cube's children.
struct Octants {
  uint32_t touched;  // may be touched by the triangle; all that are touched are here
  uint32_t inside;   // of those: the triangle covers them, they see no more than its plane
};

// What is in a block.
struct BlockContent {
  uint32_t mask;  // of the bricks that are there
  uint32_t voxels;
};

struct Kernels {
  const char* name;
  // Sets exactly the voxels of the tile that the triangle touches.
  void (*draw)(const TileTriangle<int32_t>& triangle, TileBricks& tile);
  // `inside`: the triangle covers the whole cube, which it is known not to miss.
  Octants (*test_octants)(const NarrowTriangle& triangle, const Box& cube, bool inside);
  // Sets bit i of `bits` iff least <= values[i] <= most, for `count` values, a multiple of 4; the
  // other bits of the last word are 0.
  void (*find_in_range)(const int64_t* values, int count, int64_t least, int64_t most,
                        uint64_t* bits);
  // Lists a tile's blocks that have voxels, in Morton order: numbers and keys. Bits of `existing`
  // say which these are, 8 * groups of them. Nothing of the tile stays marked as touched.
  int (*list_blocks)(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                     uint64_t* keys);
  // Writes the bricks of a block that are there one after the other; room for eight of them.
  BlockContent (*unpack)(const Block& block, uint64_t* bricks);
};

const Kernels& portable_kernels();
// Null if they were not built or this machine cannot run them.
const Kernels* avx2_kernels();
const Kernels* avx512_kernels();

// For wide triangles there is one implementation only.
void draw_wide(const TileTriangle<int64_t>& triangle, TileBricks& tile);
Octants test_octants_wide(const WideTriangle& triangle, const Box& cube, bool inside);

}  // namespace voxdag::cpu
