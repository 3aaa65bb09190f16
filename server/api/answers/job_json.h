// Converts a job to JSON (JOB in docs/api.md).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/jobs/live_job.h"
#include "server/queue/job.h"

namespace voxdag::server {

// Returns the job as JSON. `live` is null unless the job's process is running. `position` is the
// position in the queue, counted from 1; 0 if the job is not queued. `webhook` is the JSON
// of the member "webhook" (Webhooks::job_member()).
std::string job_json(const Job& job, const LiveJob* live, uint64_t position, unsigned max_attempts,
                     const std::string& webhook);

}  // namespace voxdag::server
