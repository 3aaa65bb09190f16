// The rows of the parts of a split subvolume.
#pragma once

#include <span>

#include "core/backend/backend.h"
#include "scheduler/solid/solid_rows.h"

namespace voxdag {

// Adds the rows of `parts`, octants of a subvolume with voxels of the shell, and saves them. The
// triangles are the subvolume's. Charges the rows of the subvolume and of a part to `budget`.
// Throws Error{kOutOfMemory}.
void add_part_rows(SolidRows& rows, const Cube& whole, std::span<const Cube> parts,
                   TriangleStream& triangles, MemoryBudget& budget, const CancelToken& cancel);

// Returns the views of an empty cube, from the views from its low faces.
UnitViews views_of_empty(const SolidEntry& entry, const Cube& cube, uint32_t grid_levels);

}  // namespace voxdag
