#include "scheduler/slurm/cluster_build.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/text.h"
#include "core/io/random_id.h"
#include "scheduler/slurm/batches.h"
#include "scheduler/slurm/files/batch_file.h"
#include "scheduler/slurm/files/record_check.h"
#include "scheduler/state/job_progress.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

// Of a build on this machine, which takes over what tasks have built.
const ClusterOptions kNoOptions;
// Between two looks at the folder for records.
constexpr double kLook_s = 0.5;
// Between the first two questions to Slurm; doubled up to ClusterOptions::slurm_interval_s.
constexpr double kFirstPause_s = 1;

std::string replace_all(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

// Of which tasks on other machines run the same version.
std::string this_program() {
  const std::string path = std::filesystem::read_symlink("/proc/self/exe").string();
  if (!std::filesystem::exists(path))
    throw Error(ErrorCode::kInvalidInput,
                path +
                    ": this program was replaced or removed while it runs: expected it, or its "
                    "path on the nodes, for the tasks of the cluster");
  return path;
}

std::string whole_path(const std::string& path) {
  return std::filesystem::absolute(path).lexically_normal().string();
}

}  // namespace

ClusterBuild::ClusterBuild(const BuildSpec& spec, const WorkFolder& work, JobStore& jobs,
                           const BuildContext& context, CommandRunner& commands)
    : spec_(spec),
      options_(spec.run.cluster ? *spec.run.cluster : kNoOptions),
      work_(work),
      jobs_(jobs),
      context_(context),
      files_(context.files),
      folder_(work.path()),
      slurm_(commands, context.cancel, options_.slurm_start_s) {}

void ClusterBuild::check(const BuildSpec& spec, CommandRunner& commands,
                         const BuildContext& context) {
  if (!spec.run.cache_folder.empty())
    throw Error(ErrorCode::kInvalidInput,
                "--cache: tasks of a cluster have no cache: expected "
                "--cluster without it");
  const ClusterOptions& options = *spec.run.cluster;
  Slurm slurm(commands, context.cancel, options.slurm_start_s);
  const double pause_s = std::min(kFirstPause_s, options.slurm_interval_s);
  std::vector<std::string> words = split_words(options.submit_options);
  slurm.check(words, pause_s, context.progress);
  if (!options.merge_job || options.merge_job->submit_options.empty()) return;
  const std::vector<std::string>& own = options.merge_job->submit_options;
  words.insert(words.end(), own.begin(), own.end());
  slurm.check(words, pause_s, context.progress);
}

void ClusterBuild::save_state() {
  state_.totals.requests = earlier_requests_ + slurm_.requests();
  write_file_atomically(files_, folder_.state_path(), encode_state(state_));
  is_changed_ = false;
}

// While tasks are followed: what is not saved now is saved later, or found again by the next run.
void ClusterBuild::try_to_save_state() {
  try {
    save_state();
    is_saved_ = true;
  } catch (const Error& error) {
    if (is_saved_)
      context_.progress.warn("the state of the tasks cannot be written: " + error.message());
    is_saved_ = false;
  }
}

void ClusterBuild::resume(const std::string& scene_digest, const DagShape& shape) {
  files_.make_directories(folder_.path());
  const auto earlier = read_cluster_state(files_, work_.path());
  if (earlier && earlier->scene_digest == scene_digest && earlier->shape == shape &&
      (earlier->program == options_.program_version || !spec_.run.cluster)) {
    state_ = *earlier;
  } else {
    if (earlier) {
      if (!options_.is_merge_job) slurm_.cancel(earlier->merge_job_name());
      slurm_.cancel(earlier->task_name());
    }
    state_.build = random_id();
    state_.program = options_.program_version;
    state_.scene_digest = scene_digest;
    state_.shape = shape;
  }
  earlier_requests_ = state_.totals.requests;
  // A number is never given twice, whatever became of the state: segments have it.
  for (const StoredSubvolume& subvolume : jobs_.leaves()) {
    subvolumes_[subvolume.id] = subvolume;
    if (const uint32_t segment = subvolume.artifact.segment; segment >= kFirstClusterSegment)
      state_.next_batch = std::max(state_.next_batch, segment - kFirstClusterSegment + 1);
  }
  // A batch whose subvolumes are recorded was built: this process was killed before it said so. One
  // that is of other subvolumes, or whose file is missing, is cut again.
  std::erase_if(state_.open, [&](const OpenBatch& batch) { return !is_of_this_job(batch); });
  save_state();
  accept_finished();
  remove_leftovers();
}

bool ClusterBuild::is_of_this_job(const OpenBatch& batch) const {
  return files_.exists(folder_.batch_path(batch.number)) &&
         std::ranges::all_of(batch.subvolumes, [&](const ExpectedSubvolume& expected) {
           const auto found = subvolumes_.find(expected.id);
           return found != subvolumes_.end() && found->second.cube == expected.cube &&
                  found->second.state == SubvolumeState::kPlanned;
         });
}

std::set<SubvolumeId> ClusterBuild::covered() const {
  std::set<SubvolumeId> ids;
  for (const OpenBatch& batch : state_.open)
    for (const ExpectedSubvolume& subvolume : batch.subvolumes) ids.insert(subvolume.id);
  return ids;
}

// Files of batches that were being cut or are built.
void ClusterBuild::remove_leftovers() {
  for (const ClusterFolder::Entry& entry : folder_.list(files_))
    if (entry.kind == ClusterFolder::Kind::kBatch && !state_.find(entry.batch))
      files_.remove(entry.path);
}

void ClusterBuild::add(std::span<const StoredSubvolume> subvolumes, std::span<const BinId> bins,
                       const TriangleStore& triangles, unsigned threads) {
  std::vector<size_t> order(subvolumes.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::sort(order, {}, [&](size_t i) { return morton_place(subvolumes[i].cube); });
  std::vector<BatchSubvolume> ordered;
  std::vector<BinId> ordered_bins;
  double weight = 0;
  for (const size_t i : order) {
    const StoredSubvolume& subvolume = subvolumes[i];
    subvolumes_[subvolume.id] = subvolume;
    ordered.push_back({subvolume.id, subvolume.cube, subvolume.weight, triangles.count(bins[i])});
    ordered_bins.push_back(bins[i]);
    weight += subvolume.weight;
  }
  Batch batch;
  batch.program = state_.program;
  batch.build = state_.build;
  batch.shape = state_.shape;
  batch.wide = triangles.record_bytes() == triangle_record_bytes(true);
  batch.backend = spec_.run.backend;
  batch.method = spec_.run.method;
  if (spec_.run.subvolume_edge) batch.longest_edge = static_cast<int64_t>(spec_.run.subvolume_edge);
  CutBatches cut =
      make_batches(batch, ordered, tasks_for(weight, ordered.size()), state_.next_batch);
  context_.progress.begin_stage("batches", cut.batches.size(), "batches");
  open_batches(std::move(cut), ordered_bins, triangles, threads,
               [&] { context_.progress.advance(1); });
  context_.progress.end_stage();
  save_state();
}

// Their part of all tasks, if the user has given a number.
uint64_t ClusterBuild::tasks_for(double weight, uint64_t subvolumes) const {
  if (options_.tasks == 0) return default_tasks(weight, subvolumes);
  double all = 0;
  for (const StoredSubvolume& leaf : jobs_.leaves()) all += leaf.weight;
  const double part = all > 0 ? weight / all : 1;
  return std::max<uint64_t>(
      static_cast<uint64_t>(std::llround(static_cast<double>(options_.tasks) * part)), 1);
}

// Writes the files of batches, and counts them among those to be built; the caller saves.
void ClusterBuild::open_batches(CutBatches cut, std::span<const BinId> bins,
                                const TriangleStore& triangles, unsigned threads,
                                const std::function<void()>& after_each) {
  if (state_.next_batch + cut.batches.size() >= kMaxBatches)
    throw Error(ErrorCode::kLimit, "over " + std::to_string(kMaxBatches) + " batches: start over");
  parallel_for(threads, cut.batches.size(), [&](unsigned, size_t i) {
    const Batch& batch = cut.batches[i];
    write_batch(
        files_, folder_.batch_path(batch.number), batch,
        [&](size_t item) { return triangles.open(bins[cut.first_items[i] + item]); },
        context_.cancel);
    after_each();
  });
  state_.next_batch += static_cast<uint32_t>(cut.batches.size());
  for (OpenBatch& open : cut.open) state_.open.push_back(std::move(open));
}

std::string ClusterBuild::program() const {
  return options_.program_path.empty() ? this_program() : options_.program_path;
}

void ClusterBuild::submit(const std::vector<uint32_t>& batches) {
  if (batches.empty()) return;
  ArrayRequest request;
  request.name = state_.task_name();
  // Tasks run elsewhere: they need the whole path.
  const ClusterFolder there(whole_path(work_.path()));
  request.command = {program(), "build-batch", there.work_folder(), "--batch"};
  request.batches = batches;
  request.log_folder = there.path();
  request.options = split_words(options_.submit_options);
  request.max_running = options_.max_running;
  std::map<uint32_t, SlurmTask> tasks;
  std::string refusal;
  try {
    slurm_.submit(request, tasks);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kIo) throw;
    refusal = error.message();
  }
  for (const auto& [batch, task] : tasks) {
    state_.find(batch)->task = task;
    missing_since_.erase(batch);
    own_reasons_.erase(batch);
  }
  if (state_.submitted_s == 0) state_.submitted_s = unix_seconds();
  try_to_save_state();
  // What was not submitted, or perhaps was, is looked for the next time.
  note_refusal(refusal);
}

// Says once that Slurm takes nothing now.
void ClusterBuild::note_refusal(const std::string& refusal) {
  if (!refusal.empty() && is_taking_)
    context_.progress.warn("Slurm takes no tasks now (" + refusal + "): waiting for it");
  is_taking_ = refusal.empty();
}

// What failed before does not count against a batch: the user has decided to try again.
void ClusterBuild::forget_failures() {
  for (OpenBatch& batch : state_.open) {
    batch.failures.clear();
    if (batch.task) inherited_.insert(batch.number);
  }
  own_reasons_.clear();
}

std::string ClusterBuild::submit_merge_job() {
  forget_failures();
  JobRequest request;
  request.name = state_.merge_job_name();
  request.command = options_.merge_job->arguments;
  request.command.insert(request.command.begin(), program());
  request.folder = options_.merge_job->folder;
  request.log_folder = whole_path(folder_.path());
  request.options = split_words(options_.submit_options);
  const std::vector<std::string>& own = options_.merge_job->submit_options;
  request.options.insert(request.options.end(), own.begin(), own.end());
  for (;;) {
    accept_finished();
    if (!state_.open.empty()) look_after_tasks();
    std::set<std::string> arrays;
    for (const OpenBatch& batch : state_.open)
      if (batch.task && !missing_since_.contains(batch.number)) arrays.insert(batch.task->job);
    if (!arrays.empty() || state_.open.empty()) {
      request.after.assign(arrays.begin(), arrays.end());
      try {
        const std::string job = slurm_.submit_job(request);
        save_state();
        return job;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kIo) throw;
        note_refusal(error.message());
      }
      // It may be there all the same.
      if (const std::string job = find_job(request.name); !job.empty()) return job;
    }
    context_.cancel.check();
    std::this_thread::sleep_for(std::chrono::duration<double>(options_.slurm_interval_s));
  }
}

// The id of a job, "" if there is none. Asks until Slurm answers.
std::string ClusterBuild::find_job(const std::string& name) {
  for (;;) {
    if (const auto jobs = slurm_.jobs(name)) return jobs->empty() ? "" : jobs->front().id;
    context_.cancel.check();
    std::this_thread::sleep_for(std::chrono::duration<double>(options_.slurm_interval_s));
  }
}

void ClusterBuild::follow() {
  const uint64_t total = jobs_.leaves().size();
  uint64_t open = 0;
  for (const OpenBatch& batch : state_.open) open += batch.subvolumes.size();
  context_.progress.begin_stage("build", total, "subvolumes");
  context_.progress.resume_at(total - open);
  forget_failures();
  if (!state_.open.empty()) look_after_tasks();
  double looked_s = wall_seconds();
  double pause_s = std::min(kFirstPause_s, options_.slurm_interval_s);
  while (true) {
    accept_finished();
    if (state_.open.empty()) break;
    if (is_changed_) {
      try_to_save_state();
      report_tasks();
    }
    context_.cancel.check();
    if (wall_seconds() - looked_s >= pause_s) {
      look_after_tasks();
      pause_s = std::min(2 * pause_s, options_.slurm_interval_s);
      looked_s = wall_seconds();
    }
    std::this_thread::sleep_for(
        std::chrono::duration<double>(std::min(kLook_s, options_.slurm_interval_s)));
  }
  try_to_save_state();
  report_tasks();
  context_.progress.end_stage();
}

// Records come first: a task that has written one is done, whatever Slurm says about it.
void ClusterBuild::accept_finished() {
  const std::vector<ClusterFolder::Entry> entries = folder_.list(files_);
  for (const ClusterFolder::Entry& entry : entries) {
    if (entry.kind == ClusterFolder::Kind::kRecord) take_record(entry);
    if (entry.kind == ClusterFolder::Kind::kFailure) take_failure(entry);
  }
  // What attempts left whose batches are built, killed ones for instance.
  for (const ClusterFolder::Entry& entry : entries)
    if (entry.kind == ClusterFolder::Kind::kAttempt && !state_.find(entry.batch))
      folder_.remove_attempt(files_, entry.batch, entry.attempt);
}

void ClusterBuild::take_failure(const ClusterFolder::Entry& entry) {
  if (const OpenBatch* const batch = state_.find(entry.batch)) {
    try {
      const AttemptFailure failure =
          decode_failure(read_small_file(files_, entry.path, kMaxRecordBytes));
      // One of an earlier task, which the shared disk shows late, says nothing about this one.
      const bool is_late =
          batch->task && !failure.task.empty() && failure.task != batch->task->name();
      // Tasks know the work folder by its whole path; the user knows it by another, or not at all.
      if (!is_late)
        own_reasons_[entry.batch] = {
            replace_all(failure.message, whole_path(work_.path()), work_.path()) +
                (failure.node.empty() ? "" : " (on " + failure.node + ")"),
            true};
    } catch (const Error&) {
      // Slurm will say that the task ended.
    }
  }
  folder_.remove_attempt(files_, entry.batch, entry.attempt);
}

void ClusterBuild::take_record(const ClusterFolder::Entry& entry) {
  const OpenBatch* const batch = state_.find(entry.batch);
  if (!batch) {
    // Another attempt was first.
    folder_.remove_attempt(files_, entry.batch, entry.attempt);
    return;
  }
  try {
    accept(read_valid_record(files_, folder_, entry, state_, batch->subvolumes));
  } catch (const Error& error) {
    // The shared disk may show a segment later than its record.
    if (error.code() == ErrorCode::kNotFound &&
        wall_seconds() - incomplete_since_.try_emplace(entry.path, wall_seconds()).first->second <
            options_.grace_s)
      return;
    if (!error.is_corruption() && error.code() != ErrorCode::kNotFound &&
        error.code() != ErrorCode::kUnsupportedVersion)
      throw;
    context_.progress.warn("the record " + entry.path + " does not count: " + error.message());
    own_reasons_.try_emplace(entry.batch, OwnReason{error.message(), false});
    folder_.remove_attempt(files_, entry.batch, entry.attempt);
  }
}

void ClusterBuild::accept(const CompletionRecord& record) {
  std::vector<StoredSubvolume> rows;
  for (const BuiltSubvolume& built : record.subvolumes) {
    StoredSubvolume& row = subvolumes_.at(built.id);
    row.state = SubvolumeState::kBuilt;
    row.summary = built.summary;
    row.artifact = built.summary.empty() ? ArtifactRef{} : record.artifact;
    rows.push_back(row);
  }
  const std::string accepted = folder_.accepted_segment_path(record.batch);
  if (const std::string segment = segment_of_record(files_, folder_, record);
      record.artifact.bytes > 0 && segment != accepted) {
    files_.rename(segment, accepted);
    files_.sync_directory(work_.path());
  }
  jobs_.record_built(rows);
  ClusterTotals& t = state_.totals;
  const double to_start_s = record.started_s - state_.submitted_s;
  if (t.batches == 0 || to_start_s < t.first_task_s) t.first_task_s = to_start_s;
  ++t.batches;
  ++t.batches_of_node[record.node];
  t.split += record.split;
  t.rows_before += record.rows_before;
  t.rows_after += record.rows_after;
  t.cpu_s += record.cpu_s;
  t.longest_s = std::max(t.longest_s, record.wall_s);
  std::erase_if(state_.open, [&](const OpenBatch& b) { return b.number == record.batch; });
  is_changed_ = true;
  missing_since_.erase(record.batch);
  own_reasons_.erase(record.batch);
  for (const StoredSubvolume& row : rows) {
    SubvolumeStatus status = status_of(row, state_.shape.grid_levels);
    status.built = true;
    // All subvolumes of the batch share one artifact.
    status.bytes = &row == &rows.front() ? record.artifact.bytes : 0;
    context_.progress.subvolume_built(status);
  }
  context_.progress.advance(rows.size());
  folder_.remove_attempt(files_, record.batch, record.attempt);
  if (const std::string batch = folder_.batch_path(record.batch); files_.exists(batch))
    files_.remove(batch);
}

void ClusterBuild::stop_tasks(FileSystem& files, const std::string& work_folder,
                              CommandRunner& commands, bool is_merge_job) {
  const auto state = read_cluster_state(files, work_folder);
  if (!state) return;
  const CancelToken never;
  // The job that merges would submit again what is stopped.
  const bool is_merge_stopped = is_merge_job || stop_merge_job(files, work_folder, commands);
  if (!Slurm(commands, never).cancel(state->task_name()) || !is_merge_stopped)
    throw Error(ErrorCode::kIo, "the tasks may run on: expected 'scancel --name=" +
                                    (is_merge_job ? "" : state->merge_job_name() + ",") +
                                    state->task_name() + "' to succeed");
}

bool ClusterBuild::stop_merge_job(FileSystem& files, const std::string& work_folder,
                                  CommandRunner& commands) {
  const auto state = read_cluster_state(files, work_folder);
  const CancelToken never;
  return !state || Slurm(commands, never).cancel(state->merge_job_name());
}

}  // namespace voxdag
