#include "server/jobs/process/task.h"

#include <nlohmann/json.hpp>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

using nlohmann::json;

constexpr uint64_t kLargestTask = uint64_t{4} << 20;
constexpr int kReportKinds = 7;

std::string dump(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

void write_task(FileSystem& files, const std::string& path, const Task& task) {
  write_file_atomically(files, path,
                        dump({{"plan", task.kind == Task::Kind::kPlan},
                              {"request", task.text},
                              {"scene_paths", task.scene_paths},
                              {"readable", task.readable},
                              {"memory_bytes", task.memory_bytes},
                              {"threads", task.threads}}));
}

Task read_task(FileSystem& files, const std::string& path) {
  try {
    const json value = json::parse(read_small_file(files, path, kLargestTask));
    Task task;
    task.kind = value.at("plan").get<bool>() ? Task::Kind::kPlan : Task::Kind::kBuild;
    task.text = value.at("request");
    task.scene_paths = value.at("scene_paths").get<std::vector<std::string>>();
    task.readable = value.at("readable").get<std::vector<std::string>>();
    task.memory_bytes = value.at("memory_bytes");
    task.threads = value.at("threads");
    return task;
  } catch (const json::exception&) {
    throw Error(ErrorCode::kCorrupt, path + ": expected a task of voxdag serve");
  }
}

std::string report_line(const Report& r) {
  return dump(json::array({static_cast<int>(r.kind), r.text, r.unit, r.code, r.done, r.total,
                           r.voxels, r.nodes, r.bytes, r.memory_bytes, r.disk_bytes}));
}

std::optional<Report> parse_report(std::string_view line) {
  try {
    const json v = json::parse(line);
    const int kind = v.at(0);
    if (kind < 0 || kind >= kReportKinds) return {};
    return Report{static_cast<Report::Kind>(kind),
                  v.at(1),
                  v.at(2),
                  v.at(3),
                  v.at(4),
                  v.at(5),
                  v.at(6),
                  v.at(7),
                  v.at(8),
                  v.at(9),
                  v.at(10)};
  } catch (const json::exception&) {
    return {};
  }
}

}  // namespace voxdag::server
