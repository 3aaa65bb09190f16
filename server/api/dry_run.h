// The plan of a job that is not queued.
#pragma once

#include "server/api/context.h"
#include "server/http/message.h"
#include "server/jobs/job_request.h"

namespace voxdag::server {

// Runs it in a process of its own and waits for it. Throws Problem: what is wrong with the scene or
// the request, 503 if too many are being made or it takes too long.
Response dry_run(Context& context, const JobRequest& request);

}  // namespace voxdag::server
