// The paths of a job's files in DATA/jobs/ID. A job's process has this folder as its working
// directory and uses a JobFolder with an empty `path`. So its messages contain no folder of this
// machine.
#pragma once

#include <string>

namespace voxdag::server {

struct JobFolder {
  std::string path;  // "": the working directory

  std::string task() const { return file("task.json"); }  // the task of the job's process
  std::string log() const { return file("log"); }
  std::string result() const { return file("result.vdag"); }
  std::string report() const { return result() + ".report.json"; }
  std::string work() const { return file("work"); }
  std::string subvolumes() const { return file("subvolumes.json"); }
  std::string rates() const { return file("rates.json"); }  // of the last attempt that ended
  std::string preview() const { return file("preview.png"); }
  std::string file(const std::string& name) const {
    return path.empty() ? name : path + "/" + name;
  }
};

}  // namespace voxdag::server
