// Follows a job of a server and shows its progress on standard error.
#pragma once

#include <string>

#include "cli/service/service_options.h"

namespace voxdag::cli {

// Returns the JOB after it has ended: succeeded, failed or canceled. Throws Error{kCanceled} on
// Ctrl-C; the job itself continues.
Json follow_job(ServiceClient& service, const std::string& id);

// Throws an Error for a job that failed or was canceled.
void check_succeeded(const Json& job);

}  // namespace voxdag::cli
