// Whether a completion record counts: whether it is of this build, and what it names is there.
#pragma once

#include <span>
#include <string>

#include "core/geometry/cube.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/slurm/files/completion_record.h"

namespace voxdag {

// Reads the record of `entry`, of a batch with these subvolumes, and checks it and its artifact's
// roots. Throws Error{kCorrupt}, {kNotFound} or {kUnsupportedVersion} if it does not count.
CompletionRecord read_valid_record(FileSystem& files, const ClusterFolder& folder,
                                   const ClusterFolder::Entry& entry, const ClusterState& state,
                                   std::span<const ExpectedSubvolume> subvolumes);

// Where the segment of a record lies: in the folder of its attempt or, if the process that accepted
// it was killed before it had recorded that, already in the work folder.
std::string segment_of_record(FileSystem& files, const ClusterFolder& folder,
                              const CompletionRecord& record);

}  // namespace voxdag
