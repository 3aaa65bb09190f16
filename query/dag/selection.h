// Checks selections, and converts coordinates and boxes of world space to cells.
#pragma once

#include <array>
#include <cstdint>

#include "core/format/global/voxdag_reader.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Converts the coordinate `world` of world space to cells, along one axis of the grid of
// 2^grid_levels cells per edge. If the distance to a cell boundary is within the rounding error of
// a few double operations, returns the boundary. So a corner that was computed as
// `origin + cell * edge` is in this cell, and a box with such corners has no extra layer of cells.
double world_to_cells(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// Returns the cell that contains the coordinate `world`. The cell can be outside the grid. The
// result is limited to the range from -2^62 to 2^62.
int64_t world_to_cell(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// Returns the cells that `box` overlaps. The box is half-open and in world space: its low corner
// x0, y0, z0, then its high corner x1, y1, z1. No number may be NaN. An infinite number stands for
// the border of the grid.
Region world_to_region(const voxdag_reader::File& file, uint32_t grid_levels,
                       const std::array<double, 6>& box);

// Throws Error{kInvalidInput} if the selection's grid has fewer than 4 cells per edge, or more
// levels than the file's grid. `file_levels` is the number of levels of the file's grid.
void check_grid(const Selection& selection, uint32_t file_levels);

}  // namespace voxdag::query
