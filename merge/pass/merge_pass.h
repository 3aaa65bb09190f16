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
  // The final pass adds the top tree, and its last level is the root. In earlier passes the last
  // level is the level of the highest subvolume.
  bool is_final = false;
  std::span<const ArtifactReader> artifacts;
};

// The state of a pass between two levels: the results that the merge of the next level needs.
struct PassProgress {
  std::optional<uint32_t> level;     // the last merged level; nullopt before the first
  std::optional<PositionMaps> maps;  // position maps of this level
  bool wide = false;                 // true if positions in this level take two words (row.h)
  std::vector<PlacedNode> placed;    // top nodes and subvolume roots of this level
  // Roots of the subvolumes in this level and below. `index` is the root's position in the output,
  // truncated to 32 bits.
  std::vector<ArtifactRoot> roots;
};

// Runs the pass, continuing from `progress`. Calls `after_level`, if set, after every level.
// Returns the roots of the subvolumes. `index` is the root's position in `output`, truncated to 32
// bits.
std::vector<ArtifactRoot> run_merge_pass(
    const MergeContext& context, const PassTask& task, LevelOutput& output, PassProgress progress,
    const std::function<void(const PassProgress&)>& after_level);

}  // namespace voxdag
