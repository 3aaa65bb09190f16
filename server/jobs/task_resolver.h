// From a request to the task of a process: scenes found, limits applied. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "server/config/config.h"
#include "server/jobs/protocol/job_request.h"
#include "server/jobs/protocol/job_task.h"
#include "server/scenes/scene_store.h"

namespace voxdag::server {

class TaskResolver {
 public:
  // Throws Error{kInvalidInput} for a scene root that is not there.
  TaskResolver(const ServerConfig& config, SceneStore& scenes);

  // Throws RequestError: kNotFound for a scene that does not exist or is outside the configured
  // roots (with the same message), kConflict for an incomplete upload, kLimit for more memory than
  // a job may have.
  JobTask make(const JobRequest& request, JobTask::Kind kind);
  // The scenes of a request that are uploads.
  static std::vector<std::string> uploads_of(const JobRequest& request);

  // What all running jobs may have together.
  uint64_t memory_bytes() const { return memory_bytes_; }
  // What one job may have: as much as it asks for, or its share.
  uint64_t memory_of(const JobRequest& request) const;

 private:
  // Adds the scene's files and permissions to the task.
  void add_scene(const std::string& scene, JobTask& task);

  const ServerConfig& config_;
  SceneStore& scenes_;
  const uint64_t memory_bytes_;
  std::vector<std::string> roots_;  // resolved, each ending in '/'
};

}  // namespace voxdag::server
