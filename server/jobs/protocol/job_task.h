// The task of a job's process: the file task.json in its folder.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/io/file_system.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag::server {

struct JobTask {
  enum class Kind { kBuild, kPlan };
  Kind kind = Kind::kBuild;
  std::string request;                         // the text of a JobRequest
  std::map<std::string, std::string> uploads;  // its uploaded scenes: name to path
  std::vector<std::string> readable;  // files, and folders ending in '/', that scenes may refer to
  uint64_t memory_bytes = 0;          // limit if the request has no value of its own
  unsigned threads = 0;               // number if the request has no value of its own
  ClusterOptions cluster;             // as in ServerConfig
};
void write_task(FileSystem& files, const std::string& path, const JobTask& task);
// Throws Error{kCorrupt} for a file that is not a task.
JobTask read_task(FileSystem& files, const std::string& path);

}  // namespace voxdag::server
