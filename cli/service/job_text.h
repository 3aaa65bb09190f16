// Texts that describe a job of the service. `job` is the JSON object JOB of docs/api.md.
#pragma once

#include <string>

#include "client/service_client.h"

namespace voxdag::cli {

using client::Json;

// Returns a line such as "job 6b1f0c7a93d2e845: queued, number 2 in the queue".
std::string state_line(const Json& job);
// Returns the job's name, or its scenes if it has no name.
std::string job_title(const Json& job);
// Returns the job's labels, each with "  #" before it, or "" if it has none.
std::string labels_text(const Json& job);
// Returns the progress PROGRESS (docs/api.md) over all stages as text, such as "42 %, 31.4 s left".
// Leaves out the time if it is unknown or the job is not running. Returns "" if the service does
// not report this progress.
std::string overall_text(const Json& progress, bool is_running);
// Returns the progress of a job as text, such as "build: 32 %, 31.4 s left": the current stage, and
// the progress of the job over all stages. For a succeeded job, returns the size of the result,
// such as "118 MiB".
std::string progress_text(const Json& job);
// Prints the result of a succeeded job in a few lines.
void print_result(const Json& job);

}  // namespace voxdag::cli
