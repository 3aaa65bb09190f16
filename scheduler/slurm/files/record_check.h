// Checks that a completion record belongs to this build and that its segment exists.
#pragma once

#include <span>
#include <string>

#include "core/geometry/cube.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/slurm/files/completion_record.h"

namespace voxdag {

// Reads the record of `entry` for a batch with these subvolumes. Checks the record and the roots of
// its artifact. Throws Error{kCorrupt}, {kNotFound} or {kUnsupportedVersion} if the record is
// invalid.
CompletionRecord read_valid_record(FileSystem& files, const ClusterFolder& folder,
                                   const ClusterFolder::Entry& entry, const ClusterState& state,
                                   std::span<const ExpectedSubvolume> subvolumes);

// Path of a record's segment: in the attempt's folder, or in the work folder if a process that
// accepted the record was killed before it recorded the batch.
std::string segment_of_record(FileSystem& files, const ClusterFolder& folder,
                              const CompletionRecord& record);

}  // namespace voxdag
