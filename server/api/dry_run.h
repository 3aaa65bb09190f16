// The estimate of a job without queuing it.
#pragma once

#include "server/api/context.h"
#include "server/http/message.h"
#include "server/jobs/job_request.h"

namespace voxdag::server {

// Runs the plan in a child process and answers with its estimate as JSON. Throws Problem: the error
// of the scene or the request; 503 if too many plans run or this one takes too long.
Response dry_run(Context& context, const JobRequest& request);

}  // namespace voxdag::server
