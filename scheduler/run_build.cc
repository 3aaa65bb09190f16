#include "scheduler/run_build.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "scheduler/execute/open_backend.h"
#include "scheduler/job/job_progress.h"
#include "scheduler/job/output_lock.h"
#include "scheduler/job/work_folder.h"
#include "scheduler/merge_stage.h"
#include "scheduler/plan/estimate.h"
#include "scheduler/plan/prepare.h"
#include "scheduler/triangles/partition.h"

namespace voxdag {
namespace {

// Below this resolution a build fits any disk that can hold its scene: no estimate is made.
constexpr uint32_t kLevelsWorthAnEstimate = 12;
// The pilot of the check before a build is this much coarser, so that it costs next to nothing.
constexpr uint32_t kLevelsBelowForTheCheck = 5;
// Of artifacts, job store and digests of scenes; another number is another job.
constexpr int64_t kWorkFormatVersion = 2;
// How often damaged artifacts are built again before the disk is to blame.
constexpr int kMaxAttempts = 3;

// One build, stage by stage; what the work folder already has is not built again.
class Build {
 public:
  Build(const BuildSpec& spec, const BuildContext& context)
      : spec_(checked(spec)),
        budget_(spec_.run.memory_bytes),
        output_(context.files, spec_.run.output),
        work_(context.files,
              spec_.run.work_folder.empty() ? spec_.run.output + ".work" : spec_.run.work_folder),
        store_(open_store(context.files)),
        progress_(context.progress, *store_, work_),
        context_{context.files, progress_, context.cancel},
        keeper_(spec_, *store_, work_, context_) {
    if (!spec_.run.cache_folder.empty())
      cache_.emplace(context.files, spec_.run.cache_folder, spec_.run.cache_bytes);
    report_.output = spec_.run.output;
    report_.hash_bits = spec_.geometry.hash_bits;
    report_.threads = spec_.run.threads;
    report_.memory_bytes = spec_.run.memory_bytes;
  }

  BuildReport run() {
    try {
      return run_to_the_end();
    } catch (const Error& error) {
      commit_best_effort();
      // With a job, or a part of a scene that is not at fault, the folder is what goes on.
      const bool scene_is_at_fault =
          error.code() == ErrorCode::kInvalidInput || error.code() == ErrorCode::kLimit;
      if (!store_->job() && (scene_is_at_fault || !keeper_.has_saved())) {
        remove_work();
        throw;
      }
      Error told = error;
      if (error.code() == ErrorCode::kNoSpace)
        told = Error(error.code(), error.message() + space_required());
      if (error.code() == ErrorCode::kCanceled)
        told = Error(error.code(), error.message() + "; run the same command again to go on");
      progress_.record_failure(told);
      throw told;
    } catch (...) {
      commit_best_effort();
      throw;
    }
  }

 private:
  // A store that cannot be read is no obstacle to starting over; nor is one that does not look like
  // ours, where we have been before.
  std::unique_ptr<JobStore> open_store(FileSystem& files) const {
    try {
      return std::make_unique<JobStore>(work_.store_path(), JobStore::Access::kBuild);
    } catch (const Error& error) {
      const bool not_ours = error.code() == ErrorCode::kInvalidInput;
      const bool unreadable =
          error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupportedVersion;
      if (!spec_.run.restart || !(unreadable || (not_ours && work_.was_there()))) throw;
    }
    for (const char* suffix : {"", "-wal", "-shm", "-journal"})
      if (files.exists(work_.store_path() + suffix)) files.remove(work_.store_path() + suffix);
    return std::make_unique<JobStore>(work_.store_path(), JobStore::Access::kBuild);
  }

  // What is finished is not lost.
  void commit_best_effort() {
    try {
      journals_.commit();
    } catch (const std::exception&) {
      // What went wrong first is what matters.
    }
  }

  BuildReport run_to_the_end() {
    const double start = wall_seconds();
    if (start_over_)
      keeper_.forget();
    else
      refuse_other_options();
    work_.remove_spilled();
    build_missing();
    if (spec_.run.keep_work) journals_.commit_soon();
    MergeStage merge(*store_, journals_, work_, budget_, clock_, context_);
    for (int attempt = 1; !merge.run(spec_.run, report_); ++attempt) {
      if (attempt == kMaxAttempts)
        throw Error(ErrorCode::kCorrupt, work_.path() +
                                             ": artifacts are damaged again and again: "
                                             "expected a disk that gives back what was written");
      if (any_planned()) build_missing();
    }
    if (spec_.run.keep_work) journals_.commit();
    report_.stages = clock_.stages();
    report_.wall_s = wall_seconds() - start;
    report_.cpu_s = process_cpu_seconds();
    report_.peak_rss_bytes = peak_resident_bytes();
    write_file_atomically(context_.files, spec_.run.output + ".report.json",
                          report_json(report_) + "\n");
    if (!spec_.run.keep_work) remove_work();
    return report_;
  }

  bool any_planned() const {
    const std::vector<StoredSubvolume> leaves = store_->leaves();
    return std::ranges::any_of(
        leaves, [](const StoredSubvolume& s) { return s.state == SubvolumeState::kPlanned; });
  }

  // What a full disk's user needs to know, reckoned from the subvolumes built so far: their
  // artifacts and a global file of about the same size.
  std::string space_required() {
    double built = 0, planned = 0, bytes = 0;
    for (const StoredSubvolume& subvolume : store_->leaves()) {
      const bool is_built = subvolume.state == SubvolumeState::kBuilt;
      (is_built ? built : planned) += subvolume.weight;
      bytes += static_cast<double>(subvolume.artifact.bytes);
    }
    std::string needed;
    if (built > 0) {
      const double artifacts = bytes * (1 + planned / built);
      needed = " for about " + std::to_string(std::llround((2 * artifacts - bytes) / 1e6)) + " MB";
    }
    return "; the job is paused: make room" + needed + " and run the same command again";
  }

  void remove_work() {
    progress_.detach();
    journals_.drop();
    store_.reset();
    work_.remove();
  }

  // Builds what is missing. Triangles that the disk gave back changed are read from the scene
  // again; where it has no room for them, memory may.
  void build_missing() {
    for (int attempt = 1;; ++attempt) {
      try {
        return try_to_build_missing();
      } catch (const DamagedTriangles& damage) {
        if (attempt == kMaxAttempts) throw;
        context_.progress.warn(damage.message() + "; the scene is read again");
        keeper_.forget();
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kNoSpace || !keeper_.is_optional()) throw;
        context_.progress.warn(error.message() +
                               "; the scene is read again, to hold its triangles in memory");
        keeper_.give_up();
      }
    }
  }

  // Scan, ingest, and all subvolumes that are not built yet; what they hold in memory is gone when
  // it returns.
  void try_to_build_missing() {
    PreparedScene scene =
        prepare_scene(spec_, work_.spill_path(), budget_, clock_, context_, &keeper_);
    report_.grid = scene.grid;
    report_.triangles = scene.counts.triangles;
    report_.dropped_outside = scene.counts.dropped_outside;
    report_.dropped_invalid = scene.counts.dropped_invalid;
    if (report_.triangles == 0)
      context_.progress.warn("the scene has no triangles in the grid: the file will have no nodes");
    start_or_resume(scene);

    std::vector<StoredSubvolume> leaves = store_->leaves();
    report_subvolumes(leaves, scene.grid.levels, context_.progress);
    const size_t leaf_count = leaves.size();
    std::erase_if(leaves,
                  [](const StoredSubvolume& s) { return s.state != SubvolumeState::kPlanned; });
    report_.subvolumes_reused = leaf_count - leaves.size();
    if (!leaves.empty()) build_subvolumes_of(scene, leaves);
    report_.spill_bytes += scene.bins->spilled_bytes();
    const std::vector<StoredSubvolume> all = store_->leaves();
    report_.subvolumes = all.size();
    report_.artifact_bytes = report_.artifact_nodes = 0;
    for (const StoredSubvolume& subvolume : all) {
      report_.artifact_bytes += subvolume.artifact.bytes;
      report_.artifact_nodes += subvolume.summary.dag_nodes;
    }
  }

  [[noreturn]] void refuse(const std::string& difference) const {
    throw Error(ErrorCode::kInvalidInput,
                "the work folder " + work_.path() + " holds another job: " + difference +
                    "; give another folder (--work) or start over (--restart)");
  }

  // Before the scene is read.
  void refuse_other_options() const {
    const auto stored = store_->job();
    if (!stored) return;
    if (stored->format_version != kWorkFormatVersion)
      refuse("its format version is " + std::to_string(stored->format_version) +
             ", this program's " + std::to_string(kWorkFormatVersion));
    const std::string asked = geometry_json(spec_.geometry);
    if (stored->geometry != asked)
      refuse("its geometry options are " + stored->geometry + ", asked for are " + asked);
  }

  void start_or_resume(const PreparedScene& scene) {
    const auto stored = store_->job();
    if (stored && !start_over_) {
      if (stored->scene_sha256 != scene.sha256)
        refuse("its scene has other contents (SHA-256 " + stored->scene_sha256.substr(0, 16) +
               ", now " + scene.sha256.substr(0, 16) + ")");
    } else {
      check_disk_space(scene);
      std::vector<StoredSubvolume> plan(scene.plan.size());
      for (size_t i = 0; i < plan.size(); ++i) {
        plan[i].cube = scene.plan[i].cube;
        plan[i].weight = scene.plan[i].weight;
      }
      store_->start({scene.sha256, geometry_json(spec_.geometry), kWorkFormatVersion}, plan);
      start_over_ = false;
    }
    std::set<uint32_t> named;
    for (const StoredSubvolume& subvolume : store_->leaves())
      if (subvolume.state == SubvolumeState::kBuilt) named.insert(subvolume.artifact.segment);
    work_.remove_garbage([&](uint32_t segment) { return named.contains(segment); });
    if (!store_->merge()) work_.empty_scratch();
  }

  void build_subvolumes_of(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
    std::vector<QueuedSubvolume> queue =
        partition_triangles(planned, scene, keeper_, budget_.limit() / 8, context_.cancel);
    const MemoryCharge lists(budget_, queue.size() * (sizeof queue[0] + sizeof planned[0]),
                             "lists of subvolumes");
    clock_.finish("distribute");
    ExecutorOptions options;
    options.grid_levels = scene.grid.levels;
    options.hash_bits = spec_.geometry.hash_bits;
    const BackendChoice backend = choose_backend(spec_.run, context_.progress);
    report_.backend = backend.name;
    options.threads = std::min(spec_.run.threads, backend.max_workers);
    options.open_backend = backend.open;
    if (spec_.run.subvolume_edge)
      options.longest_edge = static_cast<int64_t>(spec_.run.subvolume_edge);
    options.segment_folder = work_.path();
    options.first_segment_id = work_.next_segment_id();
    options.checkpoint_interval_s = spec_.run.checkpoint_interval_s;
    if (cache_) options.cache = &*cache_;
    context_.progress.begin_stage("build", queue.size(), "subvolumes");
    const ExecutorCounts counts = build_subvolumes(options, std::move(queue), *scene.bins, *store_,
                                                   journals_, budget_, context_);
    keeper_.finish();
    report_.subvolumes_split += counts.split;
    report_.subvolumes_cached += counts.cached;
    report_.subvolumes_reused += counts.cached;
    context_.progress.end_stage();
    clock_.finish("build");
  }

  uint64_t free_disk() const {
    return std::min(context_.files.free_space(work_.path()),
                    context_.files.free_space(parent_directory(spec_.run.output)));
  }

  // Refuses a build that cannot fit before any work is done.
  void check_disk_space(const PreparedScene& scene) {
    if (spec_.run.force || scene.grid.levels < kLevelsWorthAnEstimate) return;
    if (max_disk_bytes(scene) < static_cast<double>(free_disk())) return;
    const Estimate estimate = estimate_build(scene, scene.grid.levels - kLevelsBelowForTheCheck,
                                             spec_.run.threads, budget_, context_.cancel);
    check_estimate(estimate, context_.files, work_.path(), parent_directory(spec_.run.output),
                   context_.progress);
    clock_.finish("estimate");
  }

  const BuildSpec spec_;
  MemoryBudget budget_;
  const OutputLock output_;
  WorkFolder work_;
  std::optional<ArtifactCache> cache_;
  std::unique_ptr<JobStore> store_;
  CommitQueues journals_;
  StageClock clock_{[this](const StageTime& stage) { store_->add_stage_time(stage); }};
  JobProgress progress_;
  const BuildContext context_;
  IngestCheckpoint keeper_;
  BuildReport report_;
  bool start_over_ = spec_.run.restart;
};

}  // namespace

namespace {

// What would be refused only when all is built is refused now.
void check_output(FileSystem& files, const std::string& output) {
  if (output.ends_with('/'))
    throw Error(ErrorCode::kInvalidInput, "-o " + output + ": expected a file, not a folder");
  if (files.exists(output) && files.open_read(output)->size() > 0 && !is_global_file(files, output))
    throw Error(ErrorCode::kInvalidInput,
                output +
                    " is there and is no global file of voxdag: expected a free name or that "
                    "of an earlier result (-o)");
  files.make_directories(parent_directory(output));
  const std::string probe = output + ".probe-" + std::to_string(getpid());
  files.create(probe)->close();
  files.remove(probe);
}

}  // namespace

BuildReport run_build(const BuildSpec& spec, const BuildContext& context) {
  if (spec.run.output.empty())
    throw Error(ErrorCode::kInvalidInput, "no output file was given: expected a path (-o)");
  check_output(context.files, spec.run.output);
  return Build(spec, context).run();
}

}  // namespace voxdag
