// The inputs of a merge.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/io/file_system.h"

namespace voxdag {

struct MergeInputs {
  DagShape shape;
  // The artifacts of the subvolumes, in any order; none for an empty scene. Their cubes are
  // disjoint.
  std::vector<ArtifactRef> artifacts;
  // Opens the segment file with this id.
  std::function<std::shared_ptr<ReadableFile>(uint32_t)> open_segment;
  // A folder for data that does not fit in memory. No other merge may use it at the same time.
  // After the merge it contains only files named by the state in the checkpoint.
  std::string scratch_folder;
  // Size of a hash partition above which the merge is not faster, if there are not many runs
  // (LevelRows). Above this size it is slower, because the system has to provide more pages.
  uint64_t useful_partition_bytes = uint64_t{128} << 20;
  // Minimum CPU time between two checkpoints, in seconds.
  double checkpoint_interval_s = 2;
};

}  // namespace voxdag
