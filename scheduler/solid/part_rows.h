// The sample rows (row_sums.h) of the parts of a split subvolume.
#pragma once

#include <span>

#include "core/backend/backend.h"
#include "scheduler/solid/solid_rows.h"

namespace voxdag {

// Computes the rows of `parts`, octants of the subvolume `whole`, adds them to `rows`, and saves
// `rows`. `triangles` are the triangles of `whole`. At least one of them must touch a voxel of
// `whole`. Charges the rows of `whole` and of a part to `budget`. Throws Error{kOutOfMemory}.
void add_part_rows(SolidRows& rows, const Cube& whole, std::span<const Cube> parts,
                   TriangleStream& triangles, MemoryBudget& budget, const CancelToken& cancel);

// Returns the views (core/geometry/solid_rule.h) from the corners of an empty cube. `entry` has the
// views from its low faces.
UnitViews views_of_empty(const SolidEntry& entry, const Cube& cube, uint32_t grid_levels);

}  // namespace voxdag
