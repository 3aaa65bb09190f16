// Messages about scenes that set no voxel.
#pragma once

#include <string>

#include "core/geometry/grid.h"
#include "scheduler/spec/unbuildable_job.h"

namespace voxdag {

// Returns the corners of a grid: "from 0,0,0 to 1,1,1".
std::string grid_range_text(const Grid& grid);

// Returns the error for a scene that sets no voxel. `message` names the scene and the reason. Names
// the option allow_empty to users who have it.
UnbuildableJob empty_scene_error(const std::string& message);

}  // namespace voxdag
