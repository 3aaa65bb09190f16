// Statistics of a DAG for each level, in the terms of publications about sparse voxel DAGs.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct LevelStats {
  uint64_t svo_nodes = 0;  // occurrences of the level's nodes in the octree
  // Nodes of the DAG with 1 to 8 children. The children of a brick are its octants with voxels.
  std::array<uint64_t, 8> nodes_by_children{};
};

struct DagStats {
  std::vector<LevelStats> levels;  // from the root to the bricks
  // Distinct 2x2x2 masks in the bricks. Encodings with leaves of 2^3 voxels store each of these
  // masks as an additional node.
  uint64_t octant_masks = 0;
};

// Returns the statistics of a file. Needs 8 bytes per node and 2 bits per word of two consecutive
// levels. Throws Error{kOutOfMemory} if this memory does not fit in the budget, Error{kCorrupt},
// Error{kCanceled}.
DagStats dag_stats(const voxdag_reader::File& file, MemoryBudget& budget,
                   const CancelToken& cancel);

}  // namespace voxdag::query
