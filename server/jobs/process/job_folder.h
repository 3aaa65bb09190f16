// Where a job's files lie: DATA/jobs/ID.
#pragma once

#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

struct JobFolder {
  std::string path;

  std::string task() const { return path + "/task.json"; }  // what the job's process is to do
  std::string log() const { return path + "/log"; }
  std::string result() const { return path + "/result.vdag"; }
  std::string report() const { return result() + ".report.json"; }
  std::string work() const { return path + "/work"; }
  std::string subvolumes() const { return path + "/subvolumes.json"; }
  std::string preview() const { return path + "/preview.png"; }
};

// A folder and all that is in it; nothing happens if it is not there.
void remove_tree(FileSystem& files, const std::string& path);

}  // namespace voxdag::server
