#include "server/api/dry_run.h"

#include "core/base/clock.h"
#include "core/base/error.h"
#include "server/api/problem.h"
#include "server/api/routes/router.h"
#include "server/jobs/process/child_process.h"
#include "server/random_id.h"

namespace voxdag::server {
namespace {

// The folder of a plan, removed with it.
class TemporaryTask {
 public:
  TemporaryTask(FileSystem& files, const std::string& path) : folder{path}, files_(files) {
    files_.make_directories(path);
  }
  ~TemporaryTask() {
    try {
      remove_tree(files_, folder.path);
    } catch (const Error&) {
      // The service removes it at its next start.
    }
  }
  const JobFolder folder;

 private:
  FileSystem& files_;
};

Problem problem_of(const Failure& failure) {
  for (const ErrorCode code :
       {ErrorCode::kInvalidInput, ErrorCode::kNotFound, ErrorCode::kUnsupportedVersion,
        ErrorCode::kIo, ErrorCode::kNoSpace, ErrorCode::kOutOfMemory, ErrorCode::kDevice,
        ErrorCode::kLimit, ErrorCode::kCorrupt})
    if (failure.code == error_name(code)) return problem(code, failure.text);
  return Problem(500, "internal", "the plan failed");
}

}  // namespace

Response dry_run(Context& context, const JobRequest& request) {
  const auto permit = context.plans.acquire();
  if (!permit) throw busy("too many concurrent plans", 5);
  const Task task = context.tasks.make(request, Task::Kind::kPlan);
  const TemporaryTask temporary(context.files,
                                context.config.data_folder + "/plans/" + random_id());
  write_task(context.files, temporary.folder.task(), task);
  const std::string program =
      context.config.program.empty() ? "/proc/self/exe" : context.config.program;
  ChildProcess child({{program, "run-job", temporary.folder.path},
                      temporary.folder.log(),
                      context.config.jobs.nice});
  std::string estimate;
  std::optional<Failure> failure;
  const double deadline = wall_seconds() + context.config.jobs.plan_timeout_s;
  bool timed_out = false;
  child.read_lines(
      [&](std::string_view line) {
        const auto message = decode(line);
        if (!message) return;
        if (const auto* result = std::get_if<Result>(&*message)) estimate = result->json;
        if (const auto* reported = std::get_if<Failure>(&*message)) failure = *reported;
      },
      [&] { return timed_out = timed_out || context.draining || wall_seconds() > deadline; });
  child.wait();
  if (timed_out) throw busy("the plan exceeded its time limit", 60);
  if (failure) throw problem_of(*failure);
  if (estimate.empty()) throw Problem(500, "internal", "the process of the plan crashed");
  return json_response(200, estimate);
}

}  // namespace voxdag::server
