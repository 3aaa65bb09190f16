#include "server/jobs/task_resolver.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "server/api/problem.h"
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
      throw Error(ErrorCode::kInvalidInput, "scene_roots: " + root + ": expected a folder");
    roots_.push_back(resolved.ends_with('/') ? resolved : resolved + "/");
  }
}

std::vector<std::string> TaskResolver::uploads_of(const JobRequest& request) {
  std::vector<std::string> uploads;
  for (const std::string& scene : request.scenes)
    if (!is_path(scene)) uploads.push_back(scene);
  return uploads;
}

std::string TaskResolver::find_scene(const std::string& scene, std::vector<std::string>& readable) {
  const Problem missing =
      not_found("no scene '" + scene.substr(0, 128) +
                "': expected an uploaded one, or a path below one of the scene roots");
  if (is_path(scene)) {
    const std::string path = resolved_path(scene);
    const auto root = std::find_if(roots_.begin(), roots_.end(),
                                   [&](const std::string& r) { return lies_in(path, r); });
    if (root == roots_.end() || (!path.ends_with(".glb") && !path.ends_with(".gltf")))
      throw missing;
    readable.push_back(*root);
    return path;
  }
  const auto found = is_scene_name(scene) ? scenes_.find(scene) : std::nullopt;
  if (!found) throw missing;
  if (!found->complete) throw conflict("the scene '" + scene + "' is still arriving");
  readable.push_back(scenes_.path(scene));
  return scenes_.path(scene);
}

Task TaskResolver::make(const JobRequest& request, Task::Kind kind) {
  Task task;
  task.kind = kind;
  task.text = request.text;
  for (const std::string& scene : request.scenes)
    task.scene_paths.push_back(find_scene(scene, task.readable));
  const uint64_t asked = request.spec.run.memory_bytes;
  if (asked > memory_bytes_)
    throw problem(ErrorCode::kLimit, "'memory': a job of this service may have at most " +
                                         std::to_string(memory_bytes_) + " bytes");
  task.memory_bytes = asked ? asked : memory_bytes_ / config_.jobs.max_concurrent;
  task.threads = config_.jobs.threads;
  return task;
}

}  // namespace voxdag::server
