// One round of the merge: all levels of some artifacts, from the bricks up, into one output.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/format/artifact.h"
#include "merge/level_merge.h"

namespace voxdag {

struct RoundTask {
  uint32_t grid_levels = 2;
  uint32_t hash_bits = 64;
  uint32_t number = 0;  // 0 is the last round, 1, 2, ... those before it in their order
  // Adds the top tree and goes on up to the root; otherwise up to the highest subvolume.
  bool with_top = false;
  std::span<const ArtifactReader> artifacts;
};

// The subvolumes' roots with their positions in `output` as index.
std::vector<ArtifactRoot> merge_round(const MergeSeams& seams, const RoundTask& task,
                                      LevelOutput& output, Checkpoint* checkpoint);

}  // namespace voxdag
