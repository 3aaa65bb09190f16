#include "scheduler/state/job/empty_scene.h"

#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {

std::string grid_range_text(const Grid& grid) {
  std::string low, high;
  for (const double at : grid.origin) {
    low += (low.empty() ? "" : ",") + number_text(at);
    high += (high.empty() ? "" : ",") + number_text(at + grid.edge);
  }
  return "from " + low + " to " + high;
}

UnbuildableJob empty_scene_error(const std::string& message) {
  const std::string allow = option_text("allow_empty");
  return {ErrorCode::kInvalidInput,
          message + (allow.empty() ? ": expected a scene that sets voxels in the grid"
                                   : "; " + allow + " writes a file without voxels")};
}

}  // namespace voxdag
