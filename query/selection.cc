#include "query/selection.h"

#include <string>

#include "core/base/error.h"
#include "core/dag/brick.h"

namespace voxdag::query {

void check_grid(const Selection& selection, uint32_t file_levels) {
  if (selection.grid_levels < kBrickLevels || selection.grid_levels > file_levels)
    throw Error(ErrorCode::kInvalidInput, "a grid of 2^" + std::to_string(selection.grid_levels) +
                                              " voxels per edge: expected 2^" +
                                              std::to_string(kBrickLevels) + " to 2^" +
                                              std::to_string(file_levels) + ", the file's own");
}

}  // namespace voxdag::query
