// Converts a job request to the task that a job process runs: finds the request's scenes and
// applies the configured limits. Thread-safe.
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
  // Throws Error{kInvalidInput} for a scene root that does not exist.
  TaskResolver(const ServerConfig& config, SceneStore& scenes);

  // Returns the task of a request. Throws RequestError: kNotFound for a scene that does not exist
  // or is outside the configured roots, kConflict for an incomplete upload, kLimit for more memory
  // than a job may use. The message of kNotFound does not tell whether the scene exists, so it does
  // not reveal which files exist outside the roots.
  JobTask make(const JobRequest& request, JobTask::Kind kind);
  // Returns the scenes of a request that are uploads.
  static std::vector<std::string> uploads_of(const JobRequest& request);

  // Memory limit of all running jobs together.
  uint64_t memory_bytes() const { return memory_bytes_; }
  // Returns the memory limit in bytes for one job: the requested memory, or memory_bytes() divided
  // by jobs.max_concurrent if the request has none.
  uint64_t memory_of(const JobRequest& request) const;

 private:
  // Adds the scene's files to the task. An upload becomes one of the task's uploads, and the task
  // may read its file. For a path, the task may read the complete scene root that contains the
  // path.
  void add_scene(const std::string& scene, JobTask& task);

  const ServerConfig& config_;
  SceneStore& scenes_;
  const uint64_t memory_bytes_;
  std::vector<std::string> roots_;  // resolved paths of the scene roots, each ending in '/'
};

}  // namespace voxdag::server
