// One merge pass: all levels of some artifacts, from the bricks up, into one output.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/format/artifact/artifact_reader.h"
#include "merge/load/top_tree_run.h"
#include "merge/plan/merge_context.h"

namespace voxdag {

struct PassTask {
  DagShape shape;
  // In the final pass the top tree is added and the last level is the root; in earlier passes it is
  // the level of the highest subvolume.
  bool is_final = false;
  std::span<const ArtifactReader> artifacts;
};

// How far a pass is: all that the levels above need to know of the merged ones.
struct PassProgress {
  std::optional<uint32_t> level;     // merged last; none before the bricks
  std::optional<PositionMaps> maps;  // of that level
  bool wide = false;                 // whether children in that level are wide
  std::vector<PlacedNode> placed;    // on that level
  // Roots of subvolumes on that level and below; `index` is their position in the output.
  std::vector<ArtifactRoot> roots;
};

// Continues from `progress`, and calls `after_level`, if there is one, after every level. Returns
// the roots of the subvolumes, `index` being their position in `output`.
std::vector<ArtifactRoot> run_merge_pass(
    const MergeContext& context, const PassTask& task, LevelOutput& output, PassProgress progress,
    const std::function<void(const PassProgress&)>& after_level);

}  // namespace voxdag
