#include "scheduler/state/job/empty_scene.h"

#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {
namespace {

// Returns the corners of a grid: "from 0,0,0 to 1,1,1".
std::string range_text(const Grid& grid) {
  std::string low, high;
  for (const double at : grid.origin) {
    low += (low.empty() ? "" : ",") + number_text(at);
    high += (high.empty() ? "" : ",") + number_text(at + grid.edge);
  }
  return "from " + low + " to " + high;
}

}  // namespace

std::string empty_scene_reason(const DroppedTriangles& dropped, const Grid& grid) {
  if (dropped.declared == 0) return "has no triangles";
  const std::string count = count_text(dropped.declared);
  if (dropped.invalid == dropped.declared) return "has only invalid triangles (" + count + ")";
  if (dropped.outside == dropped.declared)
    return "has " + count + (dropped.declared == 1 ? " triangle" : " triangles") +
           ", all outside the grid (" + range_text(grid) + ")";
  return "has no triangles in the grid";
}

Error empty_scene_error(const std::string& message) {
  const std::string allow = option_text("allow_empty");
  return {ErrorCode::kInvalidInput,
          message + (allow.empty() ? ": expected a scene that sets voxels in the grid"
                                   : "; " + allow + " writes a file without voxels")};
}

}  // namespace voxdag
