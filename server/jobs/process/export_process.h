// The part of a job's process (job_process.h) that runs an export.
#pragma once

#include <string>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "server/jobs/protocol/job_task.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

// Name under which the process of an export opens the result of the job: a symbolic link in its
// working directory.
inline constexpr const char* kExportInput = "result.vdag";

// Writes the files of an export into the working directory and returns an ExportResult as JSON. No
// file has its final name before it is complete. Throws Error and RequestError.
std::string run_export(FileSystem& files, const JobTask& task, Progress& progress,
                       const CancelToken& cancel);

}  // namespace voxdag::server
