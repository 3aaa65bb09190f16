// Follows a job on a server, and shows the job's progress on standard error.
#pragma once

#include <string>

#include "cli/service/service_options.h"

namespace voxdag::cli {

// Waits until the job has ended (succeeded, failed or canceled), and returns it as the JSON object
// JOB of docs/api.md. If `quiet` is true, shows only the job's warnings. Throws Error{kCanceled} on
// Ctrl-C; the job itself continues.
Json follow_job(ServiceClient& service, const std::string& id, bool quiet);

// Throws an Error for a job that failed or was canceled.
void check_succeeded(const Json& job);

}  // namespace voxdag::cli
