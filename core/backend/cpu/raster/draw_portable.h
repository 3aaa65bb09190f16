#pragma once

#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {

// Sets exactly the voxels of the tile that the triangle touches, by plain integer code.
template <class Coordinate>
void draw_exactly(const TileTriangle<Coordinate>& triangle, TileBricks& tile);

}  // namespace voxdag::cpu
