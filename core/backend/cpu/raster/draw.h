// The rasterizers: each sets exactly the voxels of the tile that the triangle touches.
#pragma once

#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {

// Plain integer code, for narrow and wide triangles and for degenerate ones.
template <class Coordinate>
void draw_exactly(const TileTriangle<Coordinate>& triangle, TileBricks& tile);
// Only for machines with AVX2 and BMI2.
void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile);
// Only for machines with AVX-512 F, BW, DQ, VL and VBMI as well.
void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile);

}  // namespace voxdag::cpu
