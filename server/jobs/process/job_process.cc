#include "server/jobs/process/job_process.h"

#include <fstream>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "scheduler/job/work_folder.h"
#include "scheduler/plan/estimate.h"
#include "scheduler/run_build.h"
#include "server/api/problem.h"
#include "server/jobs/built_watch.h"
#include "server/jobs/job_request.h"
#include "server/jobs/process/confined_files.h"
#include "server/jobs/process/job_folder.h"
#include "server/jobs/process/progress_pipe.h"
#include "server/jobs/process/task.h"

namespace voxdag::server {
namespace {

using nlohmann::ordered_json;

constexpr uint64_t kLargestReport = uint64_t{4} << 20;

// Should memory run out, the system takes this process and not the service.
void raise_oom_score() { std::ofstream("/proc/self/oom_score_adj") << 500; }

JobRequest request_of(const Task& task) {
  try {
    return parse_job_request(task.text);
  } catch (const Problem& problem) {
    throw Error(ErrorCode::kInvalidInput, problem.detail);
  }
}

BuildSpec spec_of(const Task& task, const JobFolder& folder) {
  BuildSpec spec = request_of(task).spec;
  spec.geometry.scenes = task.scene_paths;
  spec.run.output = folder.result();
  spec.run.work_folder = folder.work();
  if (spec.run.memory_bytes == 0) spec.run.memory_bytes = task.memory_bytes;
  if (spec.run.threads == 0) spec.run.threads = task.threads;
  spec.run.keep_work = true;  // it is looked at once more
  return spec;
}

ordered_json levels_of(const std::string& path) {
  const auto file = open_global_file(path);
  ordered_json levels = ordered_json::array();
  if (file->empty()) return levels;
  for (uint32_t level = 0; level <= file->brick_level(); ++level) {
    const voxdag_reader::Level& l = file->level(level);
    levels.push_back({{"level", level}, {"nodes", l.node_count}, {"bytes", 4 * l.word_count}});
  }
  return levels;
}

// The report of the build, without what does not concern clients.
std::string result_of(FileSystem& files, const JobFolder& folder) {
  const auto report = ordered_json::parse(read_small_file(files, folder.report(), kLargestReport));
  ordered_json result;
  for (const char* name : {"sha256", "bytes", "voxels", "svo_nodes", "dag_nodes", "triangles",
                           "wall_s", "cpu_s", "peak_rss_bytes", "bounds"})
    result[name] = report.at(name);
  result["levels"] = levels_of(folder.result());
  return result.dump();
}

std::string build(FileSystem& files, const Task& task, const JobFolder& folder, ProgressPipe& pipe,
                  const CancelToken& cancel) {
  // The report is written last: where it is, only the tidying up was interrupted.
  if (!files.exists(folder.report())) {
    BuiltWatch watch(files, folder, request_of(task).spec.geometry.resolution, pipe);
    run_build(spec_of(task, folder), {files, pipe, cancel});
  }
  std::string result = result_of(files, folder);
  if (files.exists(folder.work())) WorkFolder(files, folder.work()).remove();
  return result;
}

std::string plan(FileSystem& files, const Task& task, const JobFolder& folder, ProgressPipe& pipe,
                 const CancelToken& cancel) {
  return estimate_json(plan_build(spec_of(task, folder), {files, pipe, cancel}));
}

std::vector<std::pair<std::string, std::string>> private_paths(const Task& task,
                                                               const JobFolder& folder,
                                                               const JobRequest& request) {
  std::vector<std::pair<std::string, std::string>> paths;
  for (size_t i = 0; i < task.scene_paths.size(); ++i)
    paths.emplace_back(task.scene_paths[i], request.scenes[i]);
  paths.emplace_back(folder.path + "/", "");
  paths.emplace_back(folder.path, "the job's folder");
  for (const std::string& place : task.readable) paths.emplace_back(place, "");
  return paths;
}

}  // namespace

int run_job(FileSystem& files, const std::string& path, const CancelToken& cancel) {
  raise_oom_score();
  ProgressPipe pipe;
  const JobFolder folder{path};
  const auto fail = [&](ErrorCode code, const std::string& message) {
    pipe.fail(error_name(code), message);
    return exit_status(code);
  };
  try {
    const Task task = read_task(files, folder.task());
    pipe.hide(private_paths(task, folder, request_of(task)));
    std::vector<std::string> readable = task.readable;
    readable.push_back(folder.path + "/");
    ConfinedFiles confined(files, readable);
    pipe.finish(task.kind == Task::Kind::kPlan ? plan(confined, task, folder, pipe, cancel)
                                               : build(confined, task, folder, pipe, cancel));
    return 0;
  } catch (const Error& error) {
    return fail(error.code(), error.message());
  } catch (const std::system_error& error) {
    return fail(ErrorCode::kOutOfMemory, "the system has no threads or memory left");
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kOutOfMemory, "out of memory: the system refused an allocation");
  }
}

}  // namespace voxdag::server
