// One round of the merge: all levels of some artifacts, from the bricks up, into one output.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/format/artifact/artifact.h"
#include "merge/load/top_run.h"
#include "merge/sort/level_merge.h"

namespace voxdag {

struct RoundTask {
  uint32_t grid_levels = 2;
  uint32_t hash_bits = 64;
  // The last round: adds the top tree and goes on up to the root; otherwise up to the highest
  // subvolume.
  bool with_top = false;
  std::span<const ArtifactReader> artifacts;
};

// How far a round is: all that the levels above need to know of those merged.
struct RoundProgress {
  std::optional<uint32_t> level;     // merged last; none before the bricks
  std::optional<PositionMaps> maps;  // of that level
  std::vector<PlacedNode> placed;    // on that level
  std::vector<ArtifactRoot> roots;  // on that level and below, `index` their position in the output
};

// Goes on from `progress`, calling `after_level` (if there is one) with how far it is. Returns the
// subvolumes' roots with their positions in `output` as index.
std::vector<ArtifactRoot> merge_round(const MergeContext& context, const RoundTask& task,
                                      LevelOutput& output, RoundProgress progress,
                                      const std::function<void(const RoundProgress&)>& after_level);

}  // namespace voxdag
