#include "server/jobs/task_resolver.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/fields/field.h"
#include "scene/formats/formats.h"
#include "server/base/request_error.h"
#include "server/jobs/process/confined_files.h"

namespace voxdag::server {
namespace {

bool is_path(const std::string& scene) { return scene.starts_with('/'); }

}  // namespace

TaskResolver::TaskResolver(const ServerConfig& config, SceneStore& scenes)
    : config_(config),
      scenes_(scenes),
      memory_bytes_(config.jobs.memory_bytes
                        ? config.jobs.memory_bytes
                        : std::max(default_memory(), kMinMemory * config.jobs.max_concurrent)) {
  for (const std::string& root : config.scene_roots) {
    const std::string resolved = resolved_path(root);
    if (resolved.empty())
      throw Error(ErrorCode::kInvalidInput,
                  "scene_roots: " + root + " cannot be found: expected an existing folder");
    roots_.push_back(resolved.ends_with('/') ? resolved : resolved + "/");
  }
}

std::vector<std::string> TaskResolver::uploads_of(const JobRequest& request) {
  std::vector<std::string> uploads;
  for (const std::string& scene : request.scenes)
    if (!is_path(scene)) uploads.push_back(scene);
  return uploads;
}

void TaskResolver::add_scene(const std::string& scene, JobTask& task) {
  const RequestError missing(RequestError::Kind::kNotFound,
                             "no scene '" + scene.substr(0, 128) +
                                 "': expected an uploaded one, or a path below one of the scene "
                                 "roots");
  if (is_path(scene)) {
    const std::string path = resolved_path(scene);
    const auto root = std::find_if(roots_.begin(), roots_.end(),
                                   [&](const std::string& r) { return is_within(path, r); });
    if (root == roots_.end() || !has_scene_ending(path)) throw missing;
    task.readable.push_back(*root);
    return;
  }
  const auto found = is_scene_name(scene) ? scenes_.find(scene) : std::nullopt;
  if (!found) throw missing;
  if (!found->complete)
    throw RequestError(
        RequestError::Kind::kConflict,
        "the scene '" + scene + "' is still being uploaded: expected a complete upload");
  const std::string path = resolved_path(scenes_.path(scene));
  if (path.empty()) throw missing;
  task.uploads.emplace(scene, path);
  task.readable.push_back(path);
}

uint64_t TaskResolver::memory_of(const JobRequest& request) const {
  const uint64_t requested = request.spec.run.memory_bytes;
  return requested ? requested : memory_bytes_ / config_.jobs.max_concurrent;
}

JobTask TaskResolver::make(const JobRequest& request, JobTask::Kind kind) {
  JobTask task;
  task.kind = kind;
  task.request = request.text;
  for (const std::string& scene : request.scenes) add_scene(scene, task);
  task.memory_bytes = memory_of(request);
  if (task.memory_bytes > memory_bytes_)
    throw RequestError(RequestError::Kind::kLimit,
                       "'memory' is " + exact_size_text(task.memory_bytes) + ": expected at most " +
                           exact_size_text(memory_bytes_) +
                           ", the limit for a job of this service");
  task.threads = config_.jobs.threads;
  task.min_free_bytes = config_.jobs.min_free_disk_bytes;
  if (config_.jobs.cache_bytes > 0) {
    task.cache_folder = resolved_path(config_.data_folder) + "/cache";
    task.cache_bytes = config_.jobs.cache_bytes;
  }
  task.cluster = config_.cluster;
  return task;
}

}  // namespace voxdag::server
