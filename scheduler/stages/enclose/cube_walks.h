// Two passes of the stage `enclose`, which only builds with --radius V need. In these builds a cube
// of V + 1 voxels per edge walks through the empty space (core/dag/space/cube_walk.h explains the
// terms). find_blocked() is the first pass. From its result, the stage's search for enclosed space
// computes the closed positions. find_enclosed() is the second pass:
//
//   shell -> find_blocked() -> blocked positions -> closed positions -> find_enclosed() -> solid
//
// Coordinates of positions can be as low as -V. So positions have their own grid of twice the
// resolution, in which they are stored like voxels. The octant of this grid with the largest
// coordinates is the grid of the voxels.
#pragma once

#include <vector>

#include "core/dag/sub_dag.h"
#include "scheduler/solid/filled_parts.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Returns the shape of the grid of the positions. `shape` is the shape of the grid of the voxels.
DagShape position_shape(const DagShape& shape);

// Computes the blocked positions from the voxels of `shell`. Passes them to blocked.complete().
// Throws Error{kCorrupt} for a damaged artifact.
void find_blocked(BuildJob& job, const std::vector<FilledPart>& shell, FilledParts& blocked);

// Computes the enclosed voxels, which include the shell, from the closed positions in `closed`.
// Passes them to solid.complete(). Warns if all voxels of the solid are voxels of the shell. Throws
// as find_blocked() does.
void find_enclosed(BuildJob& job, const std::vector<FilledPart>& closed, FilledParts& solid);

}  // namespace voxdag
