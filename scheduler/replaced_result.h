// Protects the DAG of one scene against a build of another scene with the same output.
#pragma once

#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Throws Error{kInvalidInput} if the output is a DAG, and no report shows that an earlier build
// made it from the same scene files. Accepts any output with RunOptions::force, and if the work
// folder has a job, because the start of this job has checked the output.
void refuse_result_of_other_scene(FileSystem& files, const BuildSpec& spec);

}  // namespace voxdag
