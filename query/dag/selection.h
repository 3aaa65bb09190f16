// Checks of a selection, and selections given in world space.
#pragma once

#include <array>
#include <cstdint>

#include "core/format/global/voxdag_reader.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Converts a coordinate of world space to cells, along one axis of the grid of 2^grid_levels cells
// per edge. If the distance to a cell boundary is within the rounding error of a few double
// operations, the coordinate counts as on the boundary. So the corner of a cell, computed as origin
// + cell * edge, is in this cell, and a box with such corners has no extra layer of cells.
double world_to_cells(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// Returns the cell that contains a coordinate. The cell may be outside the grid; its magnitude is
// at most 2^62.
int64_t world_to_cell(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// Returns the cells that the half-open box x0, y0, z0, x1, y1, z1 of world space touches. The box
// must not contain NaN. A box that extends to infinity ends at the border of the grid.
Region world_to_region(const voxdag_reader::File& file, uint32_t grid_levels,
                       const std::array<double, 6>& box);

// Throws Error{kInvalidInput} if the selection's grid is finer than the file's grid or coarser than
// a brick.
void check_grid(const Selection& selection, uint32_t file_levels);

}  // namespace voxdag::query
