// The stage `enclose` of `--solid enclosed`: fills the empty voxels that no walk through empty
// voxels reaches from the border of the grid. The stage works on the artifacts of the shell (the
// voxels that triangles touch), in three steps:
//
//   label   finds the components of the empty space of each part of the grid that have a voxel at
//           the part's faces (core/dag/space/space_labels.h), and stores the labels at the faces;
//           several threads label parts
//   join    joins the components of neighboring parts where they meet; joined components that
//           reach the border of the grid are outside
//   fill    fills the enclosed components of each part (core/dag/space/enclosed_fill.h), and writes
//           the filled sub-DAG of the part as an artifact
//
// With a radius, these steps work on positions of a walking cube instead of voxels (cube_walks.h).
//
// A part is the cube of a subvolume. A subvolume that exceeds a worker's memory is processed as
// several parts. Empty cubes between the parts are components as well.
//
// Durable output: FilledParts, and with a radius two more FilledParts with the blocked and the
// closed positions. Resume rule: filled parts are kept; the labels are computed again unless all
// parts are filled.
#pragma once

#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Fills the solid, if the job is `enclosed` and not filled yet. Throws Error{kCorrupt} for a
// damaged artifact.
void enclose(BuildJob& job);

}  // namespace voxdag
