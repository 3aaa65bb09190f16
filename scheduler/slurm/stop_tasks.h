// Stops the tasks and the merge job of the cluster build in a work folder.
#pragma once

#include <string>

#include "core/io/file_system.h"
#include "scheduler/slurm/commands/command_runner.h"

namespace voxdag {

// Stops the merge job (unless this process is the merge job), then all tasks. Does nothing without
// a cluster build. If Slurm does not accept the request, throws Error{kIo} with a command that the
// user can run to stop the tasks.
void stop_cluster_tasks(FileSystem& files, const std::string& work_folder, CommandRunner& commands,
                        bool is_merge_job = false);
// Stops the merge job only. Returns false if Slurm does not accept the request.
bool stop_merge_job(FileSystem& files, const std::string& work_folder, CommandRunner& commands);

}  // namespace voxdag
