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
  enum class Kind { kBuild, kPlan, kExport };
  Kind kind = Kind::kBuild;
  std::string request;                         // text of a JobRequest; kExport: of an ExportSpec
  std::map<std::string, std::string> uploads;  // paths of the request's uploaded scenes, by name
  std::vector<std::string> readable;  // files, and folders ending in '/', that scenes may refer to
  uint64_t memory_bytes = 0;          // memory limit if the request has none
  unsigned threads = 0;               // number of threads if the request has none
  uint64_t min_free_bytes = 0;        // disk space that the job leaves free
  std::string cache_folder;           // "": no cache
  uint64_t cache_bytes = 0;           // limit of the cache folder
  ClusterOptions cluster;             // as in ServerConfig
  std::string output;                 // kExport: name of the (first) file to write
};
void write_task(FileSystem& files, const std::string& path, const JobTask& task);
// Reads a task. Throws Error{kCorrupt} for a file that is not a task.
JobTask read_task(FileSystem& files, const std::string& path);

}  // namespace voxdag::server
