// Artifacts of full cubes, in which all voxels are set.
#pragma once

#include <span>

#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/format/artifact/segment_writer.h"

namespace voxdag {

// Appends an artifact with a root for each cube. The artifact has one node per level, which all
// roots share. There must be at least one cube.
ArtifactRef add_full_cubes(SegmentWriter& segment, const DagShape& shape,
                           std::span<const Cube> cubes);

// Returns the summary of a cube in which all voxels are set and interior. If `is_disputed`, all of
// them also count as disputed.
SubDagSummary full_summary(const Cube& cube, const DagShape& shape, bool is_disputed);

}  // namespace voxdag
