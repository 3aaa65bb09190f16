// What becomes of a job when its process has ended.
#pragma once

#include "server/config/config.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"
#include "server/queue/job.h"

namespace voxdag::server {

// Seconds to wait after so many attempts that failed; they double.
double pause_s(const JobLimits& limits, unsigned attempts);

// Changes the job, which may have been suspended, resumed or asked to be canceled since it started:
//   a result                      succeeded (canceled if that was asked for)
//   stopped because we asked      as asked: canceled, suspended; queued again if the service stops
//   no_space, io                  queued again after a pause, while there are attempts left
//   anything else                 failed
void apply_outcome(Job& job, const LiveJob& live, const ChildProcess::End& end,
                   const JobLimits& limits, double now_s);

}  // namespace voxdag::server
