// Recovery from damaged artifacts, which the merge detects by their checksums.
#pragma once

#include <cstddef>

#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Reads the artifacts that the merge still needs. Plans subvolumes with damaged artifacts again,
// with a warning, and returns the number of these subvolumes.
size_t replan_damaged(BuildJob& job);

}  // namespace voxdag
