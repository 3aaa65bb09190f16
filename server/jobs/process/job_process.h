// The process that does one job: `voxdag run-job FOLDER`, started by the service alone. It reads
// FOLDER/task.json, builds with run_build(), reports by messages on standard output
// (job_messages.h), and logs in plain words on standard error.
//
// No message or log line names a folder of this machine. The process works in FOLDER and names its
// files relative to that; an uploaded scene is opened by its public name, a symbolic link in
// FOLDER; a scene below a scene root by the path that the client gave.
#pragma once

#include <string>

#include "core/io/file_system.h"
#include "server/jobs/protocol/job_folder.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// RESULT of docs/api.md for a job whose build has finished. Throws Error.
std::string finished_result(FileSystem& files, const JobFolder& folder);

// Returns the exit status; changes the working directory. After a crash at any moment the same call
// resumes the job.
int run_job(FileSystem& files, const std::string& folder, const CancelToken& cancel);

}  // namespace voxdag::server
