// What a job's process is to do: the file task.json in its folder.
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
  std::map<std::string, std::string> uploads;  // its scenes that were uploaded: name to path
  std::vector<std::string> readable;  // files, and folders ending in '/', that scenes may refer to
  uint64_t memory_bytes = 0;          // if the request does not say
  unsigned threads = 0;               // if the request does not say
  ClusterOptions cluster;             // as in ServerConfig
};
void write_task(FileSystem& files, const std::string& path, const JobTask& task);
// Throws Error{kCorrupt} for a file that is no task.
JobTask read_task(FileSystem& files, const std::string& path);

}  // namespace voxdag::server
