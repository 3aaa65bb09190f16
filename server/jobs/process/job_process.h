// The process that runs one job: `voxdag run-job FOLDER`, started only by the service. It reads
// FOLDER/task.json, builds with run_build(), reports by messages on standard output
// (job_messages.h), and logs as text on standard error.
//
// No message or log line contains a folder of this machine. For this purpose, the process works in
// FOLDER and uses file names relative to it. It opens an uploaded scene by the scene's public name,
// which is a symbolic link in FOLDER. It opens a scene below a scene root by the path that the
// client gave.
#pragma once

#include <string>

#include "core/io/file_system.h"
#include "server/jobs/protocol/job_folder.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// Returns RESULT of docs/api.md for a job whose build has finished. Throws Error.
std::string finished_result(FileSystem& files, const JobFolder& folder);

// Runs the job in `folder` and returns the exit status for the process. Changes the working
// directory. After a crash at any time, the same call resumes the job.
int run_job(FileSystem& files, const std::string& folder, const CancelToken& cancel);

}  // namespace voxdag::server
