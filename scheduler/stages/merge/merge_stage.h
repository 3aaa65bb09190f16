// The merge stage: turns the artifacts of all subvolumes into the levels of the global file.
//
// Resume rule: the merge continues at its checkpoint in the job store. When the merge starts, the
// artifacts that CommitQueue received last are possibly not durable yet. They become durable before
// a checkpoint refers to them.
#pragma once

#include <span>
#include <vector>

#include "core/format/artifact/artifact.h"
#include "core/format/global/global_writer.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Returns each artifact of the subvolumes once, even if several subvolumes share the artifact.
// `store_path` is the job store that lists the subvolumes, for messages.
std::vector<ArtifactRef> distinct_artifacts(std::span<const StoredSubvolume> subvolumes,
                                            const std::string& store_path);

// Writes all levels to `out` and fills in the report.
void merge_artifacts(BuildJob& job, GlobalFileWriter& out);

}  // namespace voxdag
