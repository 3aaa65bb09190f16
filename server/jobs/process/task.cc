#include "server/jobs/process/task.h"

#include <nlohmann/json.hpp>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

using nlohmann::json;

constexpr uint64_t kMaxTaskBytes = uint64_t{4} << 20;

}  // namespace

void write_task(FileSystem& files, const std::string& path, const Task& task) {
  const json value = {{"plan", task.kind == Task::Kind::kPlan},
                      {"request", task.request},
                      {"uploads", task.uploads},
                      {"readable", task.readable},
                      {"memory_bytes", task.memory_bytes},
                      {"threads", task.threads}};
  write_file_atomically(files, path, value.dump(-1, ' ', false, json::error_handler_t::replace));
}

Task read_task(FileSystem& files, const std::string& path) {
  try {
    const json value = json::parse(read_small_file(files, path, kMaxTaskBytes));
    Task task;
    task.kind = value.at("plan").get<bool>() ? Task::Kind::kPlan : Task::Kind::kBuild;
    task.request = value.at("request");
    task.uploads = value.at("uploads");
    task.readable = value.at("readable").get<std::vector<std::string>>();
    task.memory_bytes = value.at("memory_bytes");
    task.threads = value.at("threads");
    return task;
  } catch (const json::exception&) {
    throw Error(ErrorCode::kCorrupt, path + ": expected a task of voxdag serve");
  }
}

}  // namespace voxdag::server
