#include "server/jobs/protocol/job_task.h"

#include "core/base/error.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"

namespace voxdag::server {

constexpr std::array<const char*, 3> enum_names(JobTask::Kind) {
  return {"build", "plan", "export"};
}

template <class Visitor>
void fields(Visitor& visit, JobTask& task) {
  visit("kind", task.kind);
  visit("request", task.request);
  visit("uploads", task.uploads);
  visit("readable", task.readable);
  visit("memory_bytes", task.memory_bytes);
  visit("threads", task.threads);
  visit("min_free_bytes", task.min_free_bytes);
  visit("cache_folder", task.cache_folder);
  visit("cache_bytes", task.cache_bytes);
  visit.object("cluster", [&](auto& cluster) {
    cluster("engine", task.cluster.engine);
    cluster("tasks", task.cluster.tasks);
    cluster("max_running", task.cluster.max_running);
    cluster("submit_options", task.cluster.submit_options);
    cluster("program_path", task.cluster.program_path);
    cluster("max_retries", task.cluster.max_retries);
    cluster("grace_s", task.cluster.grace_s);
  });
  visit(Field("output").omit_empty(), task.output);
}

void write_task(FileSystem& files, const std::string& path, const JobTask& task) {
  write_file_atomically(files, path, json_text(record_json(task)));
}

JobTask read_task(FileSystem& files, const std::string& path) {
  constexpr uint64_t kMaxTaskBytes = uint64_t{4} << 20;
  return record_from_text<JobTask>(read_own_file(files, path, kMaxTaskBytes),
                                   path + ": expected a task of voxdag serve");
}

}  // namespace voxdag::server
