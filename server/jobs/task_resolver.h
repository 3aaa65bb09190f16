// From what was asked for to what a process can do: scenes found, limits applied. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "server/config.h"
#include "server/jobs/job_request.h"
#include "server/jobs/process/task.h"
#include "server/scenes/scene_store.h"

namespace voxdag::server {

class TaskResolver {
 public:
  TaskResolver(const ServerConfig& config, SceneStore& scenes);

  // Throws Problem: 404 for a scene that is not there (or lies outside the configured roots: which
  // of the two is not said), 409 for one that is still arriving, 422 (`limit`) for more memory than
  // a job may have.
  Task make(const JobRequest& request, Task::Kind kind);
  // Those of its scenes that are uploads.
  static std::vector<std::string> uploads_of(const JobRequest& request);

  // What all running jobs may have together.
  uint64_t memory_bytes() const { return memory_bytes_; }

 private:
  // Adds what the scene may refer to; returns where it lies.
  std::string find_scene(const std::string& scene, std::vector<std::string>& readable);

  const ServerConfig& config_;
  SceneStore& scenes_;
  const uint64_t memory_bytes_;
  std::vector<std::string> roots_;  // resolved, each ending in '/'
};

}  // namespace voxdag::server
