#include <algorithm>
#include <set>
#include <thread>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/checksum.h"
#include "scene/formats/formats.h"
#include "scheduler/cluster/advice_on_tasks.h"
#include "scheduler/cluster/cluster.h"
#include "scheduler/slurm/cluster_context.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/cluster_state.h"

namespace voxdag {
namespace {

constexpr uint64_t kMaxReportBytes = uint64_t{1} << 24;
// Pause between two searches for the merge job's files.
constexpr double kFilesPauseS = 0.5;
// Maximum time until an NFS client sees a new file, if the client has looked for this file before
// it existed: the default of the mount option acdirmax (nfs(5)), and a margin.
constexpr double kMaxDelayS = 75;
// Bytes from the end of a log that are quoted in a message.
constexpr uint64_t kMaxTailBytes = 600;

// Returns the last lines of a file; "" if it cannot be read.
std::string last_lines(FileSystem& files, const std::string& path) {
  try {
    const auto file = files.open_own(path);
    const uint64_t bytes = std::min(file->size(), kMaxTailBytes);
    std::string text(static_cast<size_t>(bytes), '\0');
    file->read_at(file->size() - bytes, std::as_writable_bytes(std::span(text)));
    if (bytes < file->size()) text.erase(0, text.find('\n') + 1);
    while (text.ends_with('\n')) text.pop_back();
    return text;
  } catch (const Error&) {
    return "";
  }
}

// Returns the error code with which voxdag ended in the job. Slurm reports voxdag's exit status as
// STATUS:SIGNAL. Returns kIo if the job ended for another reason.
ErrorCode code_of(const SlurmEnd& end) {
  if (end.state != "FAILED") return ErrorCode::kIo;
  for (int code = 0; code <= static_cast<int>(ErrorCode::kLimit); ++code)
    if (end.exit_code == std::to_string(exit_status(static_cast<ErrorCode>(code))) + ":0")
      return static_cast<ErrorCode>(code);
  return ErrorCode::kIo;
}

std::string request_digest(const BuildSpec& spec, const TriangleSource& scene) {
  std::string text = geometry_json(spec.geometry);
  std::vector<SourceFile> files = scene.files();
  if (spec.geometry.attributes.any())
    for (const ImageSource& image : scene.materials().images) files.push_back(image.file);
  for (const auto& [path, identity] : files)
    text += '\0' + path + '\0' + std::to_string(identity.bytes) + '\0' +
            std::to_string(identity.modified_ns);
  return sha256_hex(text);
}

class SlurmMergeJob : public MergeJob {
 public:
  SlurmMergeJob(const BuildSpec& spec, const TriangleSource& scene, const BuildContext& context)
      : spec_(spec),
        options_(*spec.run.cluster),
        context_(context),
        folder_(work_folder_of(spec.run)),
        slurm_(commands_of(spec), context.cancel),
        request_(request_digest(spec, scene)) {}

  const std::string& request() const override { return request_; }
  std::optional<BuildReport> finished() const override;
  bool has_remaining_work() const override;
  void forget_finished() override;
  bool is_alive() override;
  BuildReport follow(const std::string& id) override;

 private:
  std::optional<std::vector<SlurmJob>> query_jobs();
  void set_names(const ClusterState& state);
  void report_state(const SlurmJob& job);
  void cancel_held(const SlurmJob& job);
  void show_progress();
  [[noreturn]] void fail(const std::string& id, const std::optional<SlurmEnd>& end) const;

  const BuildSpec& spec_;
  const ClusterOptions& options_;
  const BuildContext& context_;
  const ClusterFolder folder_;
  Slurm slurm_;
  const std::string request_;
  bool is_answering_ = true;
  bool is_running_ = false;
  uint64_t shown_built_ = 0;
  std::set<std::string> warned_reasons_;  // reported reasons why the job waits
  // The names of the merge job and of the tasks in Slurm, from the last cluster state that was
  // read. They are kept because a finished merge job removes the state.
  std::string name_, task_name_;
};

std::optional<BuildReport> SlurmMergeJob::finished() const {
  const std::string path = report_path(spec_.run);
  try {
    if (!context_.files.exists(path)) return std::nullopt;
    const BuildReport report = decode_report(read_own_file(context_.files, path, kMaxReportBytes));
    if (report.merge_request == request_ &&
        context_.files.open_read(spec_.run.output)->size() == report.bytes)
      return report;
  } catch (const Error&) {
    // The output or the report is missing, or the file is not a report.
  }
  return std::nullopt;
}

void SlurmMergeJob::forget_finished() {
  if (finished()) context_.files.remove(report_path(spec_.run));
}

std::optional<std::vector<SlurmJob>> SlurmMergeJob::query_jobs() {
  const auto jobs = slurm_.jobs(name_);
  if (!jobs && is_answering_)
    context_.progress.warn("Slurm does not answer (squeue): waiting for it");
  is_answering_ = jobs.has_value();
  return jobs;
}

bool SlurmMergeJob::is_alive() {
  const auto state = read_cluster_state(context_.files, folder_.work_folder());
  if (!state) return false;
  set_names(*state);
  for (;;) {
    if (const auto jobs = query_jobs()) return !jobs->empty();
    std::this_thread::sleep_for(std::chrono::duration<double>(options_.slurm_interval_s));
    context_.cancel.check();
  }
}

bool SlurmMergeJob::has_remaining_work() const {
  return !spec_.run.keep_work &&
         context_.files.exists(WorkFolder::store_path(folder_.work_folder()));
}

void SlurmMergeJob::set_names(const ClusterState& state) {
  name_ = state.merge_job_name();
  task_name_ = state.task_name();
}

BuildReport SlurmMergeJob::follow(const std::string& submitted) {
  std::string id = submitted;
  double queried_s = -options_.slurm_interval_s, gone_since_s = 0;
  context_.progress.begin_stage("build", 0, "batches");
  std::optional<BuildReport> report;
  for (;;) {
    report = finished();
    if (report && !has_remaining_work()) break;
    show_progress();
    const double now_s = wall_seconds();
    if (now_s - queried_s >= options_.slurm_interval_s) {
      queried_s = now_s;
      const auto jobs = query_jobs();
      if (jobs && !jobs->empty()) {
        id = jobs->front().id;
        report_state(jobs->front());
        cancel_held(jobs->front());
        gone_since_s = 0;
      } else if (jobs) {
        // On a shared file system the job's files can become visible after Slurm reports that the
        // job has ended.
        if (gone_since_s == 0) gone_since_s = now_s;
        const double gone_s = now_s - gone_since_s;
        if (gone_s >= options_.grace_s) {
          if (report) break;
          const auto end = id.empty() ? std::nullopt : slurm_.end_of(id);
          if (!end || end->state != "COMPLETED" || gone_s >= options_.grace_s + kMaxDelayS)
            fail(id, end);
        }
      }
    }
    if (context_.cancel.canceled())
      throw Error(ErrorCode::kCanceled,
                  "canceled; job " + id + " and its tasks run on: " + advice_on_tasks());
    std::this_thread::sleep_for(
        std::chrono::duration<double>(std::min(kFilesPauseS, options_.slurm_interval_s)));
  }
  context_.progress.end_stage();
  return *report;
}

// Cancels the merge job and the build's tasks if Slurm could not start them and holds them. A
// waiting merge job starts when these tasks have ended, and resubmits their batches. A canceled
// merge job is resubmitted when the user runs the same command again.
void SlurmMergeJob::cancel_held(const SlurmJob& job) {
  std::vector<std::string> given_up;
  if (job.is_held()) given_up.push_back(job.id);
  if (job.state == "PENDING") {
    const auto tasks = slurm_.active(task_name_);
    for (const SlurmTask& task : tasks.value_or(std::vector<SlurmTask>{}))
      if (task.is_held()) given_up.push_back(task.name());
  }
  if (!given_up.empty() && slurm_.cancel_tasks(given_up))
    context_.progress.warn("Slurm could not start and holds " + std::to_string(given_up.size()) +
                           " tasks, such as " + given_up[0] + ": canceled");
}

// Reports once that the job is running. If the job waits for a reason that needs a person to act,
// reports each such reason once.
void SlurmMergeJob::report_state(const SlurmJob& job) {
  if (job.state == "PENDING" && !waits_for_its_turn(job.reason) &&
      warned_reasons_.insert(job.reason).second)
    context_.progress.warn("merge job " + job.id + " waits: " + job.reason);
  if (job.state == "RUNNING" && !is_running_)
    context_.progress.warn("merge job " + job.id + " is running: see its log in " + folder_.path());
  is_running_ = job.state == "RUNNING";
}

// Shows the number of built batches: completion records, plus batches the merge job has accepted.
void SlurmMergeJob::show_progress() {
  std::optional<ClusterState> state;
  try {
    state = read_cluster_state(context_.files, folder_.work_folder());
  } catch (const Error&) {
    // Ignores the error. If it is permanent, the merge job reports it.
  }
  if (!state) return;
  set_names(*state);
  std::set<uint32_t> recorded;
  for (const ClusterFolder::Entry& entry : folder_.list(context_.files))
    if (entry.kind == ClusterFolder::Kind::kRecord) recorded.insert(entry.batch);
  const uint64_t open = state->open.size();
  const uint64_t built = state->totals.batches + std::min<uint64_t>(recorded.size(), open);
  context_.progress.set_total(state->totals.batches + open);
  if (built <= shown_built_) return;
  context_.progress.advance(built - shown_built_);
  shown_built_ = built;
}

void SlurmMergeJob::fail(const std::string& id, const std::optional<SlurmEnd>& end) const {
  const std::string log = folder_.path() + "/log-" + id + ".txt";
  const std::string log_end = last_lines(context_.files, log);
  throw Error(end ? code_of(*end) : ErrorCode::kIo,
              "the job " + id + " that merges has ended without a result: " +
                  (end ? end->text() : "Slurm does not report how") +
                  (log_end.empty() ? "" : "; its log " + log + " ends with:\n" + log_end) + "\n" +
                  repeat_text() + " to submit it again");
}

}  // namespace

std::unique_ptr<MergeJob> make_merge_job(const BuildSpec& spec, const TriangleSource& scene,
                                         const BuildContext& context) {
  return std::make_unique<SlurmMergeJob>(spec, scene, context);
}

}  // namespace voxdag
