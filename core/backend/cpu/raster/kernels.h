// The dispatch table of the inner loops (kernels). There are three sets of kernels:
//
//   portable   needs no instruction set extensions
//   AVX2       also needs FMA and BMI2
//   AVX-512    needs F, BW, DQ, VL and VBMI; the kernels that it does not replace are AVX2's
//
// The set is chosen at run time. All sets produce the same voxels. Sources in avx2/ and avx512/ are
// compiled for these instruction sets. So nothing in them, including inline functions of shared
// headers, may run before the choice is made. The kernels are stateless.
#pragma once

#include <cstdint>

#include "core/backend/cpu/raster/slices.h"
#include "core/backend/cpu/raster/thin_triangle.h"
#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"
#include "core/backend/cpu/raster/triangle_set.h"
#include "core/backend/cpu/raster/voxel_block.h"

namespace voxdag::cpu {

// Sets of children of a cube, as bit masks.
struct Octants {
  uint32_t touched;  // every child that the triangle touches, and possibly some others
  uint32_t inside;   // touched children that the triangle covers (see Entry in triangle_set.h)
};

struct VoxelBlockContent {
  uint32_t mask;    // bit i is set if brick i is not empty
  uint32_t voxels;  // number of voxels in the block
};

struct Kernels {
  const char* name;
  // Sets exactly the voxels of the tile that the triangle touches.
  void (*draw)(const TileTriangle<int32_t>& triangle, TileBricks& tile);
  // Sets exactly the voxels of the tile that the rule kThin sets for the triangle.
  void (*draw_thin)(const ThinTriangle<int32_t>& triangle, TileBricks& tile);
  // Finds the children of the cube that the triangle may touch. Requires that the triangle touches
  // the cube. `inside`: true if the triangle covers the cube (see Entry in triangle_set.h).
  Octants (*test_octants)(const NarrowTriangle& triangle, const LatticeCube& cube, bool inside);
  // Sets bit i of `bits` to 1 iff low <= values[i] <= high, for `count` values. `count` must be a
  // multiple of 4. The other bits of the last word are 0.
  void (*find_in_range)(const int64_t* values, int count, int64_t low, int64_t high,
                        uint64_t* bits);
  // Finds the non-empty blocks among the first 8 * groups voxel blocks of the tile, and returns the
  // number of these blocks. Writes their indexes in TileBricks::blocks to `numbers` and their keys
  // (block_key()) to `keys`, in Morton order. Sets bit i of `existing`, which has 8 * groups bits,
  // to 1 if block i is not empty, otherwise to 0. Clears TileBricks::touched of all 8 * groups
  // blocks. `numbers` and `keys` need space for one element more than the number that is returned.
  int (*list_blocks)(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                     uint64_t* keys);
  // Copies the non-empty bricks of a voxel block to the front of `bricks`, which has space for
  // eight.
  VoxelBlockContent (*unpack)(const VoxelBlock& block, uint64_t* bricks);
  // This kernel and the next two are for solids. Finds the components of a block's empty voxels
  // (see BlockComponents in slices.h). classes[c] is the class of corner c
  // (TileViews::classes_at()).
  void (*find_components)(const VoxelBlock& block, const int32_t (&classes)[8],
                          BlockComponents& out);
  // Extends `reached`, which must be a part of `empty`, to all voxels that a path of 6-neighbors
  // within `empty` connects to it.
  void (*flood)(const Slices& empty, Slices& reached);
  // Adds `voxels` to a block, in which they must be empty. Returns the number of added voxels.
  uint32_t (*add_slices)(const Slices& voxels, VoxelBlock& block);
};

const Kernels& portable_kernels();
// Return the kernels for AVX2 and for AVX-512, or null if this build does not have them or this
// machine cannot run them.
const Kernels* avx2_kernels();
const Kernels* avx512_kernels();

// The rasterizers: each sets exactly the voxels of the tile that the triangle touches.
//
// draw_exactly() is plain integer code, for narrow, wide (triangle_set.h) and degenerate triangles.
template <class Coordinate>
void draw_exactly(const TileTriangle<Coordinate>& triangle, TileBricks& tile);
// Requires a machine with AVX2, FMA and BMI2.
void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile);
// Also requires AVX-512 F, BW, DQ, VL and VBMI.
void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile);

// The rasterizers of the rule kThin: each sets exactly the voxels that the rule sets for the
// triangle. They require the same instruction sets as the rasterizers above.
template <class Coordinate>
void draw_thin_exactly(const ThinTriangle<Coordinate>& triangle, TileBricks& tile);
void draw_thin_avx2(const ThinTriangle<int32_t>& triangle, TileBricks& tile);
void draw_thin_avx512(const ThinTriangle<int32_t>& triangle, TileBricks& tile);

// Wide triangles have a portable implementation only.
void draw_wide(const TileTriangle<int64_t>& triangle, TileBricks& tile);
void draw_thin_wide(const ThinTriangle<int64_t>& triangle, TileBricks& tile);
Octants test_octants_wide(const WideTriangle& triangle, const LatticeCube& cube, bool inside);

}  // namespace voxdag::cpu
