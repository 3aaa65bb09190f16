// The color grid divides the cube of the voxel grid (R^3 voxels) into K^3 cells, with K =
// 2^color_levels <= R. Its set cells are the octree's nodes of level color_levels. Colors are baked
// by regions, which are octree-aligned cubes of at most 64^3 color cells.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

// log2 of a full region's edge in color cells.
inline constexpr uint32_t kRegionLevels = 6;

struct ColorGrid {
  uint32_t levels = 2;        // L, the levels of the voxel grid: R = 2^L
  uint32_t color_levels = 2;  // c, the level of the color cells: K = 2^c, 2 <= c <= L

  // log2 of a color cell's edge in lattice units (1/256 voxel): 8 to 26.
  VOXDAG_HD int cell_bits() const { return kUnitBits + static_cast<int>(levels - color_levels); }
  // Returns the level of full regions, or 0 if the complete grid is smaller than a full region.
  VOXDAG_HD uint32_t region_level() const {
    return color_levels > kRegionLevels ? color_levels - kRegionLevels : 0;
  }
};

}  // namespace voxdag
