// Finds the connected components of the voxels of a file.
//
// find_components() visits the octree from the root down, and joins the components of the children
// of each cube (cube_components.h). It keeps the results of nodes for their next occurrence, and
// drops the results that were not used for the longest time if the memory is full. So the memory
// limit affects the time but not the result. The cubes from the root to the current cube must fit
// in memory, with their children.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "query/components/cube_components.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct ComponentsReport {
  uint64_t components = 0;
  // The largest components, at most ComponentRule::largest. Components of equal size are sorted by
  // the low corners of their boxes (x, then y, then z), then by the high corners.
  std::vector<Component> largest;
};

// Throws Error{kOutOfMemory} if the faces of the cubes do not fit in the budget, Error{kCorrupt},
// Error{kLimit} and Error{kCanceled}. `progress` counts voxels.
ComponentsReport find_components(const voxdag_reader::File& file, const ComponentRule& rule,
                                 MemoryBudget& budget, Progress& progress,
                                 const CancelToken& cancel);

}  // namespace voxdag::query
