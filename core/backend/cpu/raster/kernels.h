// The dispatch table of the inner loops: portable, for AVX2 with FMA and BMI2, and some of them for
// AVX-512 (F, BW, DQ, VL, VBMI), chosen at run time; all set the same voxels. Sources in avx2/ and
// avx512/ are compiled for these instruction sets, so nothing in them, including inline functions
// of shared headers, may run before the choice is made. The kernels are stateless.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"
#include "core/backend/cpu/raster/triangle_set.h"
#include "core/backend/cpu/raster/voxel_block.h"

namespace voxdag::cpu {

// Bit masks of the children of a cube.
struct Octants {
  uint32_t touched;  // every child that the triangle touches, and possibly some others
  // Children of `touched` that are inside the triangle's projection, so that the plane test
  // decides.
  uint32_t inside;
};

struct VoxelBlockContent {
  uint32_t mask;  // mask of the non-empty bricks
  uint32_t voxels;
};

struct Kernels {
  const char* name;
  // Sets exactly the voxels of the tile that the triangle touches.
  void (*draw)(const TileTriangle<int32_t>& triangle, TileBricks& tile);
  // Requires that the triangle touches the cube. `inside`: the triangle covers the complete cube.
  Octants (*test_octants)(const NarrowTriangle& triangle, const LatticeCube& cube, bool inside);
  // Sets bit i of `bits` iff low <= values[i] <= high, for `count` values, a multiple of 4; the
  // other bits of the last word are 0.
  void (*find_in_range)(const int64_t* values, int count, int64_t low, int64_t high,
                        uint64_t* bits);
  // Lists numbers and keys of a tile's non-empty voxel blocks in Morton order, and sets their bits
  // in `existing` (8 * groups bits). Clears all touched marks of the tile.
  int (*list_blocks)(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                     uint64_t* keys);
  // Copies the non-empty bricks of a voxel block to the front of `bricks`, which has space for
  // eight.
  VoxelBlockContent (*unpack)(const VoxelBlock& block, uint64_t* bricks);
};

const Kernels& portable_kernels();
// The kernels for AVX2 and AVX-512; null if they were not built or this machine cannot run them.
const Kernels* avx2_kernels();
const Kernels* avx512_kernels();

// The rasterizers: each sets exactly the voxels of the tile that the triangle touches.
// Plain integer code, for narrow and wide triangles and for degenerate ones.
template <class Coordinate>
void draw_exactly(const TileTriangle<Coordinate>& triangle, TileBricks& tile);
// Requires a machine with AVX2, FMA and BMI2.
void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile);
// Also requires AVX-512 F, BW, DQ, VL and VBMI.
void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile);

// Wide triangles have a portable implementation only.
void draw_wide(const TileTriangle<int64_t>& triangle, TileBricks& tile);
Octants test_octants_wide(const WideTriangle& triangle, const LatticeCube& cube, bool inside);

}  // namespace voxdag::cpu
