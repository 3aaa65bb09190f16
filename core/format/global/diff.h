// The voxels in which two global files differ, by walking both DAGs together: a pair of nodes that
// was met before is not walked again, so the cost goes with the DAGs and not with the voxels.
// Hash bits and the order of the nodes may differ, grids may not.
#pragma once

#include <cstdint>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag {

struct DiffReport {
  uint64_t only_a = 0;  // voxels
  uint64_t only_b = 0;
  bool same() const { return only_a == 0 && only_b == 0; }
};

// Throws Error{kInvalidInput} for different resolutions or bounds, Error{kCorrupt} for a damaged
// file. Memory: 24 to 48 bytes a pair of nodes, charged to the budget.
DiffReport diff_global_files(const voxdag_reader::File& a, const voxdag_reader::File& b,
                             MemoryBudget& budget, const CancelToken& cancel);

}  // namespace voxdag
