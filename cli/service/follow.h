// Follows a job to its end, with its progress on standard error.
#pragma once

#include <string>

#include "cli/service/service_client.h"

namespace voxdag::cli {

// The JOB as it ended: succeeded, failed or canceled. A server that restarts meanwhile is waited
// for. Ctrl-C is Error{kCanceled}; the job goes on.
Json follow_job(Server& server, const std::string& id);

// Throws the error of a job that failed or was canceled.
void check_succeeded(const Json& job);

}  // namespace voxdag::cli
