// Determines the new state of a job after its process has ended.
#pragma once

#include "server/config/config.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"
#include "server/queue/job.h"

namespace voxdag::server {

// Returns the pause in seconds after `attempts` failed attempts. The pause doubles with each
// attempt, up to limits.max_backoff_s.
double pause_s(const JobLimits& limits, unsigned attempts);

// Sets the job's new state. A client may have suspended, resumed or canceled the job since its
// start:
//   outcome of the process   new state
//   a result                 succeeded; canceled if a client requested that
//   stopped on request       canceled or suspended, as requested; queued if the service is stopping
//   no_space, io             queued again after a pause, while attempts remain; then failed
//   anything else            failed
void apply_outcome(Job& job, const LiveJob& live, const ChildProcess::End& end,
                   const JobLimits& limits, double now_s);

}  // namespace voxdag::server
