#include "server/jobs/protocol/job_task.h"

#include "core/base/error.h"
#include "server/base/json_text.h"

namespace voxdag {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ClusterOptions, engine, tasks, max_running, submit_options,
                                   program_path, max_retries, grace_s)

}  // namespace voxdag

namespace voxdag::server {

NLOHMANN_JSON_SERIALIZE_ENUM(JobTask::Kind,
                             {{JobTask::Kind::kBuild, "build"}, {JobTask::Kind::kPlan, "plan"}})
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(JobTask, kind, request, uploads, readable, memory_bytes, threads,
                                   cluster)

void write_task(FileSystem& files, const std::string& path, const JobTask& task) {
  write_file_atomically(files, path, json_text(nlohmann::json(task)));
}

JobTask read_task(FileSystem& files, const std::string& path) {
  constexpr uint64_t kMaxTaskBytes = uint64_t{4} << 20;
  try {
    return nlohmann::json::parse(read_small_file(files, path, kMaxTaskBytes)).get<JobTask>();
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorCode::kCorrupt, path + ": expected a task of voxdag serve");
  }
}

}  // namespace voxdag::server
