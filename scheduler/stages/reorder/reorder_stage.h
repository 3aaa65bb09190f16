// The reorder stage of a build with the node order first-parent. In such a build, the merge writes
// its levels, which are in the order by hash, to a file in the work folder. This stage writes them
// in the new order to the output file.
//
// Resume rule: the merge resumes its own file. The reorder stage starts over.
#pragma once

#include "core/format/global/global_writer.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Writes all levels of `merged` to `out`. `merged` must have all levels of the merge, and is sealed
// here.
void reorder_levels(BuildJob& job, GlobalFileWriter& merged, GlobalFileWriter& out);

}  // namespace voxdag
