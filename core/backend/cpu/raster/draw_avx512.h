#pragma once

#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {

// draw_avx2() in vectors twice as long. Only for machines with AVX-512 F, BW, DQ, VL and VBMI.
void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile);

}  // namespace voxdag::cpu
