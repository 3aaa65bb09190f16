// Messages about scenes that set no voxel.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "core/geometry/grid.h"

namespace voxdag {

// Numbers of triangles of a scene without triangles in the grid.
struct DroppedTriangles {
  uint64_t declared = 0;  // triangles that the scene's files declare
  uint64_t invalid = 0, outside = 0;
};
// Returns why such a scene has no triangles in the grid: "has no triangles".
std::string empty_scene_reason(const DroppedTriangles& dropped, const Grid& grid);

// Returns the error for a scene that sets no voxel. `message` names the scene and the reason. Names
// the option allow_empty to users who have it.
Error empty_scene_error(const std::string& message);

}  // namespace voxdag
