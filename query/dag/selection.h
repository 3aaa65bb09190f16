// Checks of a selection, and selections given in world space.
#pragma once

#include <array>
#include <cstdint>

#include "core/format/global/voxdag_reader.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Converts a coordinate of world space to cells along an axis of the grid of 2^grid_levels cells
// per edge. A coordinate counts as on a cell boundary if its distance is within the rounding of a
// few double operations. So the corner of a cell, computed as origin + cell * edge, is in this
// cell, and a box of such corners has no extra layer.
double world_to_cells(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// Returns the cell of a coordinate, possibly outside the grid, with a magnitude of at most 2^62.
int64_t world_to_cell(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world);
// Returns the cells touched by the half-open box x0, y0, z0, x1, y1, z1 of world space. The box
// must not contain NaN. An infinite box ends at the border of the grid.
Region world_to_region(const voxdag_reader::File& file, uint32_t grid_levels,
                       const std::array<double, 6>& box);

// Throws Error{kInvalidInput} for a grid that is finer than the file's grid, or coarser than a
// brick.
void check_grid(const Selection& selection, uint32_t file_levels);

}  // namespace voxdag::query
