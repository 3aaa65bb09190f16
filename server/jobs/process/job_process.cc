#include "server/jobs/process/job_process.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <new>
#include <nlohmann/json.hpp>
#include <system_error>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/fields/json_text.h"
#include "core/format/global/open_global.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"
#include "scheduler/state/work_folder.h"
#include "server/base/request_error.h"
#include "server/jobs/process/confined_files.h"
#include "server/jobs/process/export_process.h"
#include "server/jobs/process/progress_pipe.h"
#include "server/jobs/protocol/job_request.h"
#include "server/jobs/protocol/job_task.h"
#include "server/jobs/protocol/spell_options.h"

namespace voxdag::server {
namespace {

using nlohmann::ordered_json;

constexpr uint64_t kMaxReportBytes = uint64_t{4} << 20;
constexpr int kInternalExitStatus = 1;

// Makes the OOM killer choose this process instead of the service.
void raise_oom_score() { std::ofstream("/proc/self/oom_score_adj") << 500; }

void enter(const std::string& folder) {
  if (chdir(folder.c_str()) != 0)
    throw Error(ErrorCode::kIo, "cannot enter the job's folder: " + errno_text(errno));
}

// Creates symbolic links to the task's uploads in the working directory. Their names are the public
// names of the scenes.
void link_uploads(const JobTask& task) {
  for (const auto& [name, path] : task.uploads) {
    std::error_code failure;
    std::filesystem::remove(name, failure);
    if (!failure) std::filesystem::create_symlink(path, name, failure);
    if (failure)
      throw Error(code_of_errno(failure.value()),
                  "cannot link the scene " + name + ": " + errno_text(failure.value()));
  }
}

// Returns a file system that can read only the scene's files and the files of this build.
ConfinedFiles confined(FileSystem& files, const JobTask& task, const JobFolder& folder) {
  const std::string here = resolved_path(".") + "/";
  std::vector<std::string> readable = task.readable;
  readable.push_back(here + folder.work() + "/");
  for (const char* suffix : {"", ".partial", ".lock"}) {
    readable.push_back(here + folder.result() + suffix);
    readable.push_back(here + folder.report() + suffix);
  }
  if (!task.cache_folder.empty()) readable.push_back(task.cache_folder + "/");
  return ConfinedFiles(files, readable);
}

BuildSpec spec_of(const JobTask& task, const JobFolder& folder) {
  const JobRequest request = parse_job_request(task.request);
  BuildSpec spec = request.spec;
  spec.geometry.scenes = request.scenes;
  spec.run.output = folder.result();
  spec.run.work_folder = folder.work();
  if (spec.run.memory_bytes == 0) spec.run.memory_bytes = task.memory_bytes;
  if (spec.run.threads == 0) spec.run.threads = task.threads;
  spec.run.min_free_bytes = task.min_free_bytes;
  if (!task.cache_folder.empty()) {
    spec.run.cache_folder = task.cache_folder;
    spec.run.cache_bytes = task.cache_bytes;
  }
  if (task.cluster.engine != ClusterEngine::kNone) {
    spec.run.cluster = task.cluster;
    spec.run.cluster->program_version = VOXDAG_VERSION;
  }
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

// Returns the members of a build's report that clients may see, and the sizes of the DAG's levels.
std::string result_json(const std::string& report_text, const std::string& output) {
  const auto report = parse_json<ordered_json>(report_text);
  ordered_json result;
  for (const char* name : {"sha256", "bytes", "voxels", "svo_nodes", "dag_nodes", "triangles",
                           "wall_s", "cpu_s", "peak_rss_bytes", "bounds"})
    result[name] = report.at(name);
  result["levels"] = levels_of(output);
  return exact_json_text(result);
}

// Runs or resumes the build and returns its RESULT, the JSON that docs/api.md defines. The .vdag
// file and the report are the last files that a build writes. If both exist, an earlier run has
// finished the build. Then this function only removes the work folder, if it is still there, and
// makes the RESULT from these two files.
std::string build(const BuildSpec& spec, const JobFolder& folder, const BuildContext& context) {
  if (!context.files.exists(folder.report()) || !context.files.exists(folder.result()))
    return result_json(report_json(run_build(spec, context)), spec.run.output);
  if (context.files.exists(folder.work()))
    WorkFolder(context, folder.work(), spec.run.lock_wait_s).remove();
  return finished_result(context.files, folder);
}

std::string do_task(FileSystem& files, const JobFolder& folder, Progress& progress,
                    const CancelToken& cancel) {
  const JobTask task = read_task(files, folder.task());
  set_audience(kJobUsers);
  link_uploads(task);
  if (task.kind == JobTask::Kind::kExport) return run_export(files, task, progress, cancel);
  ConfinedFiles readable = confined(files, task, folder);
  const BuildContext context{readable, progress, cancel};
  const BuildSpec spec = spec_of(task, folder);
  if (task.kind == JobTask::Kind::kPlan) return estimate_json(plan_build(spec, context));
  // Without a job store and a report, this run starts from the beginning. The subvolume list of an
  // earlier run must then be removed, because the scene may have changed.
  if (!files.exists(WorkFolder::store_path(folder.work())) && !files.exists(folder.report()) &&
      files.exists(folder.subvolumes()))
    files.remove(folder.subvolumes());
  return build(spec, folder, context);
}

}  // namespace

std::string finished_result(FileSystem& files, const JobFolder& folder) {
  return result_json(read_own_file(files, folder.report(), kMaxReportBytes), folder.result());
}

int run_job(FileSystem& files, const std::string& path, const CancelToken& cancel) {
  raise_oom_score();
  const JobFolder folder;
  ProgressPipe pipe(files, folder.subvolumes());
  const auto fail = [&](ErrorCode code, const std::string& message) {
    pipe.fail(error_name(code), message);
    return exit_status(code);
  };
  try {
    enter(path);
    pipe.finish(do_task(files, folder, pipe, cancel));
    return 0;
  } catch (const Error& error) {
    return fail(error.code(), error.message());
  } catch (const RequestError& error) {
    return fail(ErrorCode::kInvalidInput, error.message());
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kOutOfMemory, out_of_memory_error().message());
  } catch (const std::system_error& error) {
    // The message of a std::system_error can contain paths. So clients get only the system's text
    // for its error number. The message for a lack of memory contains no path.
    const Error known = voxdag::error_of(error);
    return fail(known.code(), known.code() == ErrorCode::kOutOfMemory
                                  ? known.message()
                                  : errno_text(error.code().value()));
  } catch (const std::exception&) {
    // The exception's text is not sent, because messages of libraries may contain paths.
    pipe.fail("internal",
              "internal error in the process of the job: retry the job, and report the defect if "
              "it fails again");
    return kInternalExitStatus;
  }
}

}  // namespace voxdag::server
