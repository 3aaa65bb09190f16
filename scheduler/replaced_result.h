// Decides which files a build may replace: not the DAG of another scene, and no file that another
// program writes while the build runs.
#pragma once

#include "core/io/outputs/guarded_outputs.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// Throws Error{kInvalidInput} if the output is a DAG, and no report shows that an earlier build
// made it from the same scene files. Does not check the output if RunOptions::force is set, or if
// the work folder has a job: the run that started this job has checked the output.
void refuse_result_of_other_scene(FileSystem& files, const BuildSpec& spec);

// Guards the build's output files from now on. The files that exist now may be replaced.
void guard_outputs(GuardedOutputs& files, const RunOptions& run);

// Call it when the job has its locks. If another build wrote output files while this build waited
// for a lock, checks the places again (check_places()), refuses the result of another scene, and
// guards the new files.
void check_changed_output(BuildJob& job, GuardedOutputs& files);

}  // namespace voxdag
