// Recovery from damaged artifacts, which the merge detects by their checksums.
#pragma once

#include <cstddef>

#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Reads the artifacts that the merge still needs and plans subvolumes with damaged ones again, with
// a warning. Returns their number.
size_t replan_damaged(BuildJob& job);

}  // namespace voxdag
