// The passes of the stage `enclose` for walks of a cube of V + 1 voxels per edge (--radius V,
// core/dag/space/cube_walk.h). They come before and after the search for enclosed space:
//
//   shell -> find_blocked() -> blocked positions -> closed positions -> find_enclosed() -> solid
//
// A position may have coordinates down to -V. So positions are cubes of a larger grid, with twice
// the resolution, whose last octant is the grid of the voxels.
#pragma once

#include <vector>

#include "core/dag/sub_dag.h"
#include "scheduler/solid/filled_parts.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Returns the shape of the grid of the positions. `shape` is the shape of the grid of the voxels.
DagShape position_shape(const DagShape& shape);

// Completes `blocked`: the blocked positions of the walks around the voxels of `shell`. Throws
// Error{kCorrupt} for a damaged artifact.
void find_blocked(BuildJob& job, const std::vector<FilledPart>& shell, FilledParts& blocked);

// Completes `solid`: the enclosed voxels and the voxels of the shell. `closed` has the closed
// positions. Warns if no voxel is enclosed. Throws like find_blocked().
void find_enclosed(BuildJob& job, const std::vector<FilledPart>& closed, FilledParts& solid);

}  // namespace voxdag
