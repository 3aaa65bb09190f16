// Runs a child process to its end on behalf of a LiveJob.
#pragma once

#include <functional>

#include "server/config/config.h"
#include "server/jobs/live_job.h"
#include "server/jobs/process/child_process.h"

namespace voxdag::server {

// Runs a process to its end and applies its messages to `live`. Calls `on_message` after each
// message. If `live` gets a stop request, requests the process to stop, and kills the process
// `stop_timeout_s` later. Also kills it after it has run for `max_s` seconds.
ChildProcess::End run_child(const ChildProcess::Start& start, LiveJob& live, double stop_timeout_s,
                            double max_s, const std::function<void()>& on_message);

}  // namespace voxdag::server
