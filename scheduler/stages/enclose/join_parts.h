// Joins the components of the empty space of all parts of the grid where they meet, and finds the
// components that reach the border of the grid.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "scheduler/solid/row_file.h"
#include "scheduler/solid/seed.h"
#include "scheduler/stages/enclose/part_faces.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct OutsideSpace {
  std::vector<std::vector<uint8_t>> of_parts;  // for each part and component: 1 if it is outside
  std::vector<Cube> enclosed_cubes;            // the enclosed empty cubes between the parts
  bool is_seed_outside = false;  // the empty space around the seed reaches the border of the grid
};

// Joins the components where parts and empty cubes meet, and finds the components that are outside.
// A component is outside if it reaches the border of the grid or, in a build with a seed, does not
// reach the seed. `faces` has the quadtrees of the parts. Throws Error{kOutOfMemory} if the budget
// cannot hold five bytes for each component.
OutsideSpace find_outside(const std::vector<LabeledPart>& parts, const RowFile& faces,
                          const std::optional<Seed>& seed, uint32_t grid_levels,
                          MemoryBudget& budget, const CancelToken& cancel);

}  // namespace voxdag
