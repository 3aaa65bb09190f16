// Refuses to replace the DAG of one scene by the DAG of another scene.
#pragma once

#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Throws Error{kInvalidInput} if the output is a DAG, and no report shows that an earlier build
// made it from the same scene files. Does not check the output if RunOptions::force is set, or if
// the work folder has a job: the run that started this job has checked the output.
void refuse_result_of_other_scene(FileSystem& files, const BuildSpec& spec);

}  // namespace voxdag
