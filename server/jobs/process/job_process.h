// The process that does one job: `voxdag run-job FOLDER`, started by the service alone. It reads
// FOLDER/task.json, builds with run_build(), reports by lines on standard output (task.h), and logs
// in plain words on standard error. Neither shows a path of this machine.
#pragma once

#include <string>

#include "core/base/cancel_token.h"
#include "core/io/file_system.h"

namespace voxdag::server {

// Returns the exit status. After a crash at any moment the same call goes on where it was.
int run_job(FileSystem& files, const std::string& folder, const CancelToken& cancel);

}  // namespace voxdag::server
