#include "scheduler/slurm/run_batch.h"

#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <optional>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/segment_writer.h"
#include "core/io/host_name.h"
#include "core/io/random_id.h"
#include "core/io/temporary_paths.h"
#include "merge/merge.h"
#include "scheduler/slurm/files/batch_file.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/record_check.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/build/choose_backend.h"
#include "scheduler/stages/build/executor.h"

namespace voxdag {
namespace {

// Returns Slurm's name of this node, else the host name.
std::string node_name() {
  const char* const node = std::getenv("SLURMD_NODENAME");
  return node ? node : host_name();
}

uint64_t environment_number(const char* name) {
  const char* const text = std::getenv(name);
  return text ? std::strtoull(text, nullptr, 10) : 0;
}

// Minimum part of the allocation that is kept for the program itself, buffers and page tables.
constexpr uint64_t kProgramBytes = uint64_t{96} << 20;
constexpr std::string_view kTemporaryName = "voxdag-batch-";
constexpr const char* kTemporaryLock = "/lock";

// A temporary folder on this machine. The next task of the same user removes the folders of killed
// tasks, which it recognizes by their free locks.
class TemporaryFolder {
 public:
  TemporaryFolder(FileSystem& files, const std::string& parent) : files_(files) {
    remove_abandoned(parent);
    // Until the folder is locked, another task can consider it abandoned and remove it.
    for (int attempt = 0; !lock_ && attempt < 100; ++attempt) {
      path_ = make_temporary_folder(parent + "/" + std::string(kTemporaryName));
      try {
        lock_ = files_.try_lock(path_ + kTemporaryLock);
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kNotFound) throw;
      }
    }
    if (!lock_)
      throw Error(
          ErrorCode::kIo,
          path_ + " is in use by another process: expected a folder that only this task uses");
    registered_.emplace(path_);
  }
  ~TemporaryFolder() {
    try {
      remove_tree(files_, path_);
    } catch (const Error&) {
      // Remaining files cost only space.
    }
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  // True for a folder of this user that nobody else can change.
  static bool is_private(const std::string& path) {
    struct stat found {};
    return lstat(path.c_str(), &found) == 0 && S_ISDIR(found.st_mode) &&
           found.st_uid == geteuid() && (found.st_mode & 0777) == 0700;
  }
  void remove_abandoned(const std::string& parent) {
    for (const DirectoryEntry& entry : files_.list(parent)) {
      const std::string path = parent + "/" + entry.name;
      if (!entry.name.starts_with(kTemporaryName) || !is_private(path)) continue;
      try {
        if (!files_.exists(path + kTemporaryLock)) continue;
        if (const auto lock = files_.try_lock(path + kTemporaryLock)) remove_tree(files_, path);
      } catch (const Error&) {
        // Another task is possibly removing the folder at the same time.
      }
    }
  }

  FileSystem& files_;
  std::string path_;
  std::unique_ptr<FileLock> lock_;
  std::optional<TemporaryPath> registered_;
};

class Task {
 public:
  Task(const BatchRun& run, const BuildContext& context)
      : run_(run),
        context_(context),
        folder_(run.work_folder),
        attempt_(run.attempt.empty() ? random_id() : run.attempt),
        started_s_(unix_seconds()),
        begun_s_(wall_seconds()) {}

  CompletionRecord build() {
    try {
      return build_and_record();
    } catch (const Error& error) {
      // A canceled task needs no failure record.
      if (error.code() == ErrorCode::kCanceled)
        folder_.remove_attempt(context_.files, run_.batch, attempt_);
      else
        record_failure(error.message());
      throw;
    }
  }

 private:
  std::optional<CompletionRecord> earlier_record(const Batch& batch) {
    for (const ClusterFolder::Entry& entry : folder_.list(context_.files)) {
      if (entry.kind != ClusterFolder::Kind::kRecord || entry.batch != run_.batch) continue;
      try {
        const CompletionRecord record = decode_record(
            read_own_file(context_.files, entry.path, max_record_bytes(batch.subvolumes.size())));
        const bool is_complete =
            record.artifact.bytes == 0 ||
            context_.files.exists(segment_of_record(context_.files, folder_, record));
        if (record.build == batch.build && record.program == batch.program && is_complete)
          return record;
      } catch (const Error&) {
        // The submitting process reports invalid records.
      }
    }
    return std::nullopt;
  }

  CompletionRecord build_and_record() {
    FileSystem& files = context_.files;
    const BatchFile file(files, folder_.batch_path(run_.batch));
    const Batch& batch = file.batch();
    if (batch.program != run_.program)
      throw Error(ErrorCode::kUnsupportedVersion,
                  "voxdag " + run_.program + " on " + node_name() + " cannot build batch " +
                      std::to_string(run_.batch) + " of voxdag " + batch.program +
                      ": expected the same version on all machines");
    if (auto earlier = earlier_record(batch)) return *std::move(earlier);
    const Allocation given = slurm_allocation();
    RunOptions options;
    options.threads = run_.threads ? run_.threads : given.cpus > 0 ? given.cpus : default_threads();
    options.memory_bytes = run_.memory_bytes    ? run_.memory_bytes
                           : given.memory_bytes ? batch_budget(given.memory_bytes)
                                                : default_memory();
    options.backend = batch.backend;
    options.method = batch.method;
    check_backend(options, batch.rule);
    MemoryBudget budget(options.memory_bytes);
    TemporaryFolder temporary(
        files, run_.temporary_folder.empty() ? temporary_parent() : run_.temporary_folder);

    CompletionRecord record;
    record.program = batch.program;
    record.build = batch.build;
    record.batch = batch.number;
    record.attempt = attempt_;
    record.node = node_name();
    record.task = given.task;
    record.started_s = started_s_;
    JobStore jobs(temporary.path() + "/job.db", JobStore::Access::kBuild);
    build_artifacts(file, options, temporary.path(), budget, jobs, record);
    merge_artifacts(batch, jobs, temporary.path(), options.threads, budget, record);
    record.wall_s = wall_seconds() - begun_s_;
    record.cpu_s = process_cpu_seconds();
    record.peak_rss_bytes = peak_resident_bytes();
    write_file_atomically(files, folder_.record_path(run_.batch, attempt_), encode_record(record));
    return record;
  }

  void build_artifacts(const BatchFile& file, const RunOptions& run_options,
                       const std::string& temporary, MemoryBudget& budget, JobStore& jobs,
                       CompletionRecord& record) {
    const Batch& batch = file.batch();
    std::vector<StoredSubvolume> plan(batch.subvolumes.size());
    for (size_t i = 0; i < plan.size(); ++i) {
      plan[i].cube = batch.subvolumes[i].cube;
      plan[i].weight = batch.subvolumes[i].weight;
    }
    jobs.start({batch.build, "", 0}, plan);
    MemoryBudget triangle_budget(MemoryPlan::divide(budget.limit()).triangle_bytes, &budget);
    MemoryStore triangles(context_.files, temporary + "/triangles.vdspill", batch.wide,
                          triangle_budget);
    SolidRows rows(context_.files, temporary + "/rows.vddurable", batch.solid,
                   batch.shape.grid_levels, batch.build);
    const bool is_solid = batch.solid != SolidRule::kNone;
    if (is_solid) rows.start();
    const std::vector<BinId> bins =
        file.copy_to(triangles, is_solid ? &rows : nullptr, context_.cancel);
    plan = jobs.leaves();
    std::vector<QueuedSubvolume> queue;
    for (size_t i = 0; i < plan.size(); ++i) queue.push_back({plan[i], bins[i]});

    double bricks = 0;
    for (const StoredSubvolume& subvolume : plan) bricks += subvolume.weight;
    const BackendChoice backend =
        choose_backend(run_options, batch.rule, bricks, context_.progress);
    ExecutorOptions options;
    options.shape = batch.shape;
    options.rule = batch.rule;
    options.threads = std::min(run_options.threads, backend.max_workers);
    options.longest_edge = batch.longest_edge;
    options.open_backend = backend.open;
    if (is_solid) options.rows = &rows;
    options.segment_folder = temporary;
    // Checkpoints are useless, because the temporary folder does not outlive this process.
    options.checkpoint_interval_s = 1e9;
    context_.progress.begin_stage("build", queue.size(), "subvolumes");
    CommitQueues commits;
    record.split =
        build_subvolumes(options, std::move(queue), triangles, jobs, commits, budget, context_)
            .split;
    context_.progress.end_stage();
    for (size_t i = 0; i < plan.size(); ++i)
      record.subvolumes.push_back({batch.subvolumes[i].id, {}});
  }

  // Merges the subvolumes' artifacts into one artifact on the shared disk. Sets in `record` the new
  // artifact, the size of its segment, and the summary of each subvolume: the sums over the
  // subvolume's parts.
  void merge_artifacts(const Batch& batch, JobStore& jobs, const std::string& temporary,
                       unsigned threads, MemoryBudget& budget, CompletionRecord& record) {
    const std::vector<StoredSubvolume> leaves = jobs.leaves();
    MergeInputs inputs;
    inputs.shape = batch.shape;
    std::map<Cube, size_t> index_of;
    for (size_t i = 0; i < batch.subvolumes.size(); ++i) index_of[batch.subvolumes[i].cube] = i;
    for (const StoredSubvolume& leaf : leaves) {
      if (leaf.summary.empty()) continue;
      inputs.artifacts.push_back(leaf.artifact);
      Cube cube = leaf.cube;
      while (!index_of.contains(cube)) cube = cube.parent();
      SubDagSummary& summary = record.subvolumes[index_of.at(cube)].summary;
      const bool is_complete = cube == leaf.cube;
      summary.voxels += leaf.summary.voxels;
      summary.svo_nodes += leaf.summary.svo_nodes;
      summary.dag_nodes += leaf.summary.dag_nodes;
      summary.interior += leaf.summary.interior;
      summary.disputed += leaf.summary.disputed;
      summary.root_hash = is_complete ? leaf.summary.root_hash : 0;
    }
    if (inputs.artifacts.empty()) return;
    std::map<uint32_t, std::shared_ptr<ReadableFile>> segments;
    inputs.open_segment = [&](uint32_t id) {
      auto& segment = segments[id];
      if (!segment) segment = context_.files.open_own(segment_path(temporary, id));
      return segment;
    };
    inputs.scratch_folder = temporary + "/merge";
    const std::string folder = folder_.attempt_folder(run_.batch, attempt_);
    // If the folder is missing, it was removed with the build, which no longer needs this task.
    if (!context_.files.exists(folder_.path()))
      throw Error(ErrorCode::kNotFound,
                  folder_.path() + " does not exist: expected the folder of the build");
    context_.files.make_directories(folder);
    SegmentWriter out(context_.files, folder, ClusterFolder::segment_of(run_.batch), budget);
    MergeReport report;
    record.artifact = merge_to_artifact(inputs, context_.files, out, budget, threads,
                                        context_.progress, context_.cancel, report);
    out.sync();
    context_.files.sync_directory(folder_.path());
    record.segment_bytes = out.size();
    for (const StoredSubvolume& leaf : leaves) record.rows_before += leaf.summary.dag_nodes;
    record.rows_after = rows_of(folder, record.artifact);
  }

  uint64_t rows_of(const std::string& folder, const ArtifactRef& artifact) {
    const ArtifactReader reader(context_.files.open_own(segment_path(folder, artifact.segment)),
                                artifact);
    uint64_t rows = 0;
    for (const ArtifactLevel& level : reader.levels()) rows += level.rows;
    return rows;
  }

  void record_failure(const std::string& message) {
    folder_.remove_attempt(context_.files, run_.batch, attempt_);
    try {
      write_file_atomically(
          context_.files, folder_.failure_path(run_.batch, attempt_),
          encode_failure({run_.batch, attempt_, node_name(), slurm_allocation().task,
                          message.substr(0, kMaxFailureBytes / 8)}));
    } catch (const Error&) {
      // The log contains the message, and Slurm knows the exit status.
    }
  }

  const BatchRun& run_;
  const BuildContext& context_;
  const ClusterFolder folder_;
  const std::string attempt_;
  const double started_s_, begun_s_;
};

}  // namespace

Allocation slurm_allocation() {
  Allocation given;
  given.cpus = static_cast<unsigned>(environment_number("SLURM_CPUS_PER_TASK"));
  if (given.cpus == 0) given.cpus = static_cast<unsigned>(environment_number("SLURM_CPUS_ON_NODE"));
  const uint64_t per_node = environment_number("SLURM_MEM_PER_NODE");
  const uint64_t per_cpu = environment_number("SLURM_MEM_PER_CPU");
  given.memory_bytes = (per_node ? per_node : per_cpu * std::max(given.cpus, 1u)) << 20;
  // default_memory() is half of the memory that RAM and cgroup allow, so twice that is all of it.
  given.memory_bytes = std::min(given.memory_bytes, 2 * default_memory());
  const char* const job = std::getenv("SLURM_ARRAY_JOB_ID");
  const char* const index = std::getenv("SLURM_ARRAY_TASK_ID");
  if (job && index) given.task = std::string(job) + "_" + index;
  return given;
}

uint64_t batch_budget(uint64_t given_bytes) {
  const uint64_t reserved = std::max(kProgramBytes, given_bytes / 8);
  return std::max(given_bytes - std::min(given_bytes, reserved), kMinMemory);
}

uint64_t allocation_for(uint64_t budget_bytes) {
  return budget_bytes + std::max(kProgramBytes, budget_bytes / 7 + 1);
}

CompletionRecord run_batch(const BatchRun& run, const BuildContext& context) {
  return Task(run, context).build();
}

}  // namespace voxdag
