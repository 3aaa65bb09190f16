#pragma once

#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {

// Sets exactly the voxels of the tile that the triangle touches.
void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile);

}  // namespace voxdag::cpu
