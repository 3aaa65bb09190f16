#include "scheduler/run_build.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/io/overwrite.h"
#include "scheduler/check_spec.h"
#include "scheduler/slurm/cluster_build.h"
#include "scheduler/slurm/merge_job.h"
#include "scheduler/stages/attributes/color_stage.h"
#include "scheduler/stages/build/choose_backend.h"
#include "scheduler/stages/build/executor.h"
#include "scheduler/stages/merge/merge_stage.h"
#include "scheduler/stages/partition/partition_stage.h"
#include "scheduler/stages/plan/estimate.h"
#include "scheduler/state/build_locks.h"
#include "scheduler/state/full_disk_advice.h"
#include "scheduler/state/job_progress.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

// Version of artifacts, job store and digests of scenes; a job of another version is refused.
constexpr int64_t kWorkFormatVersion = 4;
// How often the scene is read, and the merge is run, before triangles and artifacts may not be
// damaged again.
constexpr int kMaxReads = 3, kMaxMerges = 3;

bool is_report(const ReadableFile& file) { return begins_with(file, "{\n  \"output\": \""); }

std::string work_folder_of(const RunOptions& options) {
  return options.work_folder.empty() ? options.output + ".work" : options.work_folder;
}

// Refuses now an output that could not be written once all is built, and folders and files whose
// writing would destroy a scene or a file that is not ours.
void check_places(const BuildSpec& spec, const BuildContext& context) {
  FileSystem& files = context.files;
  const std::string& output = spec.run.output;
  const std::string work = work_folder_of(spec.run);
  if (output.empty())
    throw Error(ErrorCode::kInvalidInput, "no output file was given: expected a path (-o)");
  if (output.ends_with('/'))
    throw Error(ErrorCode::kInvalidInput, "-o " + output + ": expected a file, not a folder");
  const auto resolved = [](const std::string& path) {
    return std::filesystem::weakly_canonical(path + "/.");
  };
  if (!spec.run.cache_folder.empty() && resolved(spec.run.cache_folder) == resolved(work))
    throw Error(ErrorCode::kInvalidInput,
                work + " is both the cache (--cache) and the work folder: expected two folders");
  const std::string partial = output + ".partial", report = report_path(output);
  const std::string outputs[] = {output, partial, report, report + ".partial",
                                 OutputLock::path_of(output)};
  refuse_own_files(spec, work, outputs, context);
  refuse_foreign_file(files, output, is_global_file, " (-o)");
  // If a job is in the work folder, the file is ours even if its first bytes are damaged.
  if (!files.exists(WorkFolder::store_path(work)))
    refuse_foreign_file(files, partial, is_partial_global_file, " (-o)");
  refuse_foreign_file(files, report, is_report, " (-o)");
  refuse_foreign_file(files, report + ".partial", is_report, " (-o)");
  files.make_directories(parent_directory(output));
  if (!spec.run.cache_folder.empty()) files.make_directories(spec.run.cache_folder);
}

// Opens the work folder's job store. With `restart`, one that cannot be read is replaced; so is one
// that does not look like a job store, if an earlier build had the folder.
std::unique_ptr<JobStore> open_job_store(FileSystem& files, const WorkFolder& work, bool restart) {
  try {
    return std::make_unique<JobStore>(work.store_path(), JobStore::Access::kBuild);
  } catch (const Error& error) {
    const bool is_not_ours = error.code() == ErrorCode::kInvalidInput;
    const bool is_unreadable =
        error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupportedVersion;
    if (!restart || !(is_unreadable || (is_not_ours && work.was_there()))) throw;
  }
  for (const char* suffix : {"", "-wal", "-shm", "-journal"})
    if (files.exists(work.store_path() + suffix)) files.remove(work.store_path() + suffix);
  return std::make_unique<JobStore>(work.store_path(), JobStore::Access::kBuild);
}

std::vector<StoredSubvolume> planned_leaves(JobStore& jobs) {
  std::vector<StoredSubvolume> leaves = jobs.leaves();
  std::erase_if(leaves,
                [](const StoredSubvolume& s) { return s.state != SubvolumeState::kPlanned; });
  return leaves;
}

CommandRunner& commands_of(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->commands ? *spec.run.cluster->commands
                                                        : system_commands();
}

bool is_merge_job(const BuildSpec& spec) {
  return spec.run.cluster && spec.run.cluster->is_merge_job;
}

// One build, stage by stage. What the work folder already has is not built again.
class Build {
 public:
  Build(const BuildSpec& spec, const BuildContext& context)
      : spec_(spec),
        budget_(spec_.run.memory_bytes),
        output_lock_(lock_output(context, spec_.run.output, spec_.run.lock_wait_s)),
        work_(context, work_folder_of(spec_.run), spec_.run.lock_wait_s),
        jobs_(open_job_store(context.files, work_, spec_.run.restart)),
        progress_(context.progress, *jobs_, work_),
        context_{context.files, progress_, context.cancel},
        checkpoint_(spec_, jobs_.get(), work_, context_) {
    if (!spec_.run.cache_folder.empty())
      cache_.emplace(context.files, spec_.run.cache_folder, spec_.run.cache_bytes);
    report_.output = spec_.run.output;
    report_.hash_bits = spec_.geometry.hash_bits;
    report_.threads = spec_.run.threads;
    report_.memory_bytes = spec_.run.memory_bytes;
  }

  BuildReport run() {
    const double start_s = wall_seconds();
    resumable([&] {
      if (is_merge_job(spec_)) {
        // One that was submitted twice, or that Slurm has started again, may come too late.
        const MergeJob merge_job(spec_, work_.path(), context_, commands_of(spec_));
        if (const auto report = merge_job.finished()) {
          report_ = *report;
          return remove_finished_work();
        }
        report_.merge_request = merge_job.request();
      }
      build_or_resume();
      merge_and_report(start_s);
    });
    return report_;
  }

  // Leaves the merge, and what tasks have yet to build, to a job of the cluster: returns its id, or
  // "" if there is such a job, or its result, by now.
  std::string hand_over(MergeJob& merge_job) {
    std::string id;
    resumable([&] {
      if (!start_over_ && merge_job.finished()) return remove_finished_work();
      if (!start_over_ && merge_job.is_alive()) return;
      merge_job.forget_finished();
      build_or_resume();
      id = cluster_->submit_merge_job();
    });
    return id;
  }

 private:
  // Runs a part of the build; if it fails, what it has built stays.
  void resumable(const std::function<void()>& part) {
    try {
      part();
    } catch (const Error& error) {
      commit_best_effort();
      if (!is_worth_resuming(error)) {
        remove_work();
        throw;
      }
      const Error reported(error.code(), error.message() + advice(error.code()));
      progress_.record_failure(reported);
      throw reported;
    } catch (...) {
      commit_best_effort();
      throw;
    }
  }

  void build_or_resume() {
    if (start_over_) {
      checkpoint_.forget();
      work_.remove_colors();
      remove_tasks();
    } else {
      refuse_other_options();
    }
    work_.remove_spilled();
    build_artifacts();
  }

  void merge_and_report(double start_s) {
    if (spec_.run.keep_work) commits_.commit_in_background();
    merge_artifacts();
    if (spec_.run.keep_work) commits_.commit();
    report_.stages = clock_.stages();
    report_.wall_s = wall_seconds() - start_s;
    report_.cpu_s = process_cpu_seconds();
    report_.peak_rss_bytes = peak_resident_bytes();
    write_file_atomically(context_.files, report_path(spec_.run.output),
                          report_json(report_) + "\n");
    remove_finished_work();
  }

  // Builds what is missing. If stored triangles turn out damaged, the scene is read again; so it is
  // if the disk is full and memory can hold the triangles instead.
  void build_artifacts() {
    for (int read = 1;; ++read) {
      try {
        return read_and_build();
      } catch (const DamagedTriangles& damage) {
        if (read == kMaxReads) throw;
        context_.progress.warn(damage.message() + "; the scene is read again");
        close_segments();
        checkpoint_.forget();
      } catch (const Error& error) {
        if (error.code() != ErrorCode::kNoSpace || !checkpoint_.is_optional()) throw;
        context_.progress.warn(error.message() + "; the scene is read again, into memory");
        close_segments();
        checkpoint_.disable();
      }
    }
  }

  // Before subvolumes are queued again: what is not recorded by now never will be.
  void close_segments() {
    commit_best_effort();
    commits_.clear();
    jobs_->forget_built_in_memory();
  }

  // From the scene to artifacts of all subvolumes. The triangles are freed when it returns.
  void read_and_build() {
    PreparedScene scene = prepare_scene(spec_, budget_, clock_, context_, checkpoint_);
    const IngestCounts& counts = scene.state.counts;
    report_.grid = scene.state.grid;
    report_.triangles = counts.triangles;
    report_.dropped_outside = counts.dropped_outside;
    report_.dropped_invalid = counts.dropped_invalid;
    if (counts.triangles == 0)
      context_.progress.warn("the scene has no triangles in the grid: the file will have no nodes");
    start_or_resume_job(scene);
    context_.progress.set_grid(report_.grid.origin, report_.grid.edge);
    report_subvolumes(jobs_->leaves(), scene.state.grid.levels, context_.progress);
    const std::vector<StoredSubvolume> planned = planned_leaves(*jobs_);
    report_.subvolumes_reused = jobs_->leaves().size() - planned.size();
    if (!planned.empty())
      spec_.run.cluster ? build_on_cluster(scene, planned) : build_subvolumes_of(scene, planned);
    if (spec_.run.cluster) {
      report_.backend = "slurm";
      report_.cluster = cluster_->totals();
      report_.subvolumes_split = cluster_->totals().split;
    }
    if (scene.triangles) report_.spill_bytes += scene.triangles->file_bytes();
    report_artifacts();
  }

  void start_or_resume_job(const PreparedScene& scene) {
    if (const auto stored = start_over_ ? std::nullopt : jobs_->job()) {
      if (stored->scene_digest != scene.digest())
        refuse_job("its scene has other contents (digest " + stored->scene_digest.substr(0, 16) +
                   ", now " + scene.digest().substr(0, 16) + ")");
    } else {
      if (check_disk_space(spec_, scene, work_.path(), budget_, context_))
        clock_.finish("estimate");
      std::vector<StoredSubvolume> plan(scene.plan.size());
      for (size_t i = 0; i < plan.size(); ++i) {
        plan[i].cube = scene.plan[i].cube;
        plan[i].weight = scene.plan[i].weight;
      }
      jobs_->start({scene.digest(), geometry_json(spec_.geometry), kWorkFormatVersion}, plan);
      start_over_ = false;
    }
    if (spec_.run.cluster || context_.files.exists(work_.cluster_path())) {
      cluster_ = std::make_unique<ClusterBuild>(spec_, work_, *jobs_, context_, commands_of(spec_));
      cluster_->resume(scene.digest(), {.grid_levels = scene.state.grid.levels,
                                        .hash_bits = spec_.geometry.hash_bits});
    }
    if (!spec_.run.cluster) remove_tasks();
    // After the cluster's records were taken over: the job store names all segments now.
    std::set<uint32_t> named;
    for (const StoredSubvolume& subvolume : jobs_->leaves())
      if (subvolume.state == SubvolumeState::kBuilt) named.insert(subvolume.artifact.segment);
    work_.remove_garbage([&](uint32_t segment) { return named.contains(segment); });
    if (!jobs_->merge()) work_.empty_scratch();
  }

  // The tasks of the cluster build what is planned. The triangles go to their batches.
  void build_on_cluster(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
    const std::set<SubvolumeId> covered = cluster_->covered();
    std::vector<StoredSubvolume> added;
    std::vector<Cube> cubes;
    for (const StoredSubvolume& subvolume : planned) {
      if (covered.contains(subvolume.id)) continue;
      added.push_back(subvolume);
      cubes.push_back(subvolume.cube);
    }
    if (!added.empty()) {
      const std::vector<BinId> bins =
          partition_prepared(scene, cubes, checkpoint_, {context_, spec_.run.threads, budget_});
      clock_.finish("partition");
      cluster_->add(added, bins, *scene.triangles, spec_.run.threads);
    }
    checkpoint_.finish();
    report_.spill_bytes += scene.triangles ? scene.triangles->file_bytes() : 0;
    scene.triangles.reset();
    clock_.finish("batches");
    if (!spec_.run.cluster->merge_job) cluster_->follow();
    clock_.finish("build");
  }

  // Stops what may still run on a cluster for this work folder, a second attempt for instance, and
  // removes what it has there.
  void remove_tasks() {
    cluster_.reset();
    if (!context_.files.exists(work_.cluster_path())) return;
    try {
      ClusterBuild::stop_tasks(context_.files, work_.path(), commands_of(spec_),
                               is_merge_job(spec_));
    } catch (const Error& error) {
      // Tasks without their batches fail; they cannot harm this build.
      context_.progress.warn(error.message());
    }
    work_.remove_cluster_files();
  }

  void build_subvolumes_of(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
    std::vector<Cube> cubes;
    for (const StoredSubvolume& subvolume : planned) cubes.push_back(subvolume.cube);
    const std::vector<BinId> bins =
        partition_prepared(scene, cubes, checkpoint_, {context_, spec_.run.threads, budget_});
    std::vector<QueuedSubvolume> queue;
    for (size_t i = 0; i < planned.size(); ++i) queue.push_back({planned[i], bins[i]});
    const MemoryCharge lists(budget_, queue.size() * (sizeof queue[0] + sizeof planned[0]),
                             "lists of subvolumes");
    clock_.finish("partition");
    const BackendChoice backend = choose_backend(spec_.run, context_.progress);
    report_.backend = backend.name;
    ExecutorOptions options;
    options.shape = {.grid_levels = scene.state.grid.levels, .hash_bits = spec_.geometry.hash_bits};
    options.threads = std::min(spec_.run.threads, backend.max_workers);
    options.open_backend = backend.open;
    if (spec_.run.subvolume_edge)
      options.longest_edge = static_cast<int64_t>(spec_.run.subvolume_edge);
    options.segment_folder = work_.path();
    options.first_segment_id = work_.next_segment_id();
    options.checkpoint_interval_s = spec_.run.checkpoint_interval_s;
    if (cache_) options.cache = &*cache_;
    options.built = report_.subvolumes_reused;
    context_.progress.begin_stage("build", options.built + queue.size(), "subvolumes");
    context_.progress.resume_at(options.built);
    const ExecutorCounts counts = build_subvolumes(options, std::move(queue), *scene.triangles,
                                                   *jobs_, commits_, budget_, context_);
    checkpoint_.finish();
    report_.spill_bytes += scene.triangles->file_bytes();
    scene.triangles.reset();  // Freeing a large file takes time, which belongs to this stage.
    report_.subvolumes_split += counts.split;
    report_.subvolumes_cached += counts.cached;
    report_.subvolumes_reused += counts.cached;
    context_.progress.end_stage();
    clock_.finish("build");
  }

  void report_artifacts() {
    const std::vector<StoredSubvolume> leaves = jobs_->leaves();
    report_.subvolumes = leaves.size();
    report_.artifact_bytes = report_.artifact_nodes = 0;
    for (const ArtifactRef& artifact : distinct_artifacts(leaves))
      report_.artifact_bytes += artifact.bytes;
    for (const StoredSubvolume& subvolume : leaves)
      report_.artifact_nodes += subvolume.summary.dag_nodes;
  }

  void merge_artifacts() {
    MergeStage merge(*jobs_, commits_, work_, budget_, clock_, context_);
    const MergeStage::Sections sections{[this](GlobalFileWriter& out) { color(out); },
                                        [this] { return color_digest(); }};
    for (int run = 1; !merge.run(spec_.run, sections, report_); ++run) {
      if (run == kMaxMerges)
        throw Error(ErrorCode::kCorrupt, work_.path() +
                                             ": artifacts are damaged repeatedly: expected a disk "
                                             "that returns what was written");
      if (!planned_leaves(*jobs_).empty()) build_artifacts();
    }
  }

  bool has_attributes() const { return spec_.geometry.attributes.any(); }
  void color(GlobalFileWriter& out) {
    if (!has_attributes()) return;
    ColorStage stage = color_stage();
    report_.colors = stage.add_to(out);
    color_digest_ = stage.digest();
    report_.spill_bytes += report_.colors->spill_bytes;
    clock_.finish("color");
  }

  // Of what the colors depend on: as they were baked, or as they are in the output that is there.
  std::string color_digest() {
    if (!has_attributes() || !color_digest_.empty()) return color_digest_;
    return color_stage().digest_of(context_.files, spec_.run.output, report_.colors);
  }

  ColorStage color_stage() {
    return {{spec_.geometry, report_.grid, jobs_->job()->scene_digest, work_.path(),
             work_.colors_path(), spec_.run.checkpoint_interval_s},
            {context_, spec_.run.threads, budget_}};
  }

  [[noreturn]] void refuse_job(const std::string& difference) const {
    throw Error(ErrorCode::kInvalidInput,
                "the work folder " + work_.path() + " holds another job: " + difference +
                    "; give another folder (--work) or start over (--restart)");
  }

  // Refuses a job with other geometry options before the scene is read.
  void refuse_other_options() const {
    const auto stored = jobs_->job();
    if (!stored) return;
    if (stored->format_version != kWorkFormatVersion)
      refuse_job("its format version is " + std::to_string(stored->format_version) +
                 ", this program's " + std::to_string(kWorkFormatVersion));
    const std::string requested = geometry_json(spec_.geometry);
    if (stored->geometry != requested)
      refuse_job("its geometry options are " + stored->geometry + ", requested are " + requested);
  }

  // Records what is finished. The error that ends the build counts, not one of this.
  void commit_best_effort() {
    try {
      commits_.commit();
    } catch (const std::exception&) {
    }
  }

  // Whether the work folder has a job, or a part of a scene that is not at fault itself.
  bool is_worth_resuming(const Error& error) {
    const bool scene_is_at_fault =
        error.code() == ErrorCode::kInvalidInput || error.code() == ErrorCode::kLimit;
    return jobs_->job() || (!scene_is_at_fault && checkpoint_.has_saved());
  }

  std::string advice(ErrorCode code) {
    if (code == ErrorCode::kNoSpace) return full_disk_advice(jobs_->leaves(), has_attributes());
    if (code == ErrorCode::kCanceled && spec_.run.cluster)
      return "; its tasks run on: run the same command again to follow them, or stop them with "
             "voxdag stop-tasks";
    if (code == ErrorCode::kCanceled) return "; run the same command again to resume";
    return "";
  }

  void remove_finished_work() {
    if (!spec_.run.keep_work) remove_work();
  }

  void remove_work() {
    progress_.detach();
    commits_.clear();
    remove_tasks();
    jobs_.reset();
    work_.remove();
  }

  const BuildSpec spec_;
  MemoryBudget budget_;
  const OutputLock output_lock_;
  WorkFolder work_;
  std::optional<ArtifactCache> cache_;
  std::unique_ptr<JobStore> jobs_;
  CommitQueues commits_;
  StageClock clock_{[this](const StageTime& stage) { jobs_->add_stage_time(stage); }};
  JobProgress progress_;
  const BuildContext context_;
  IngestCheckpoint checkpoint_;
  std::unique_ptr<ClusterBuild> cluster_;  // if a cluster builds the subvolumes, or has begun to
  BuildReport report_;
  std::string color_digest_;  // of the colors that were added to the output
  bool start_over_ = spec_.run.restart;
};

}  // namespace

BuildReport run_build(const BuildSpec& spec, const BuildContext& context) {
  const BuildSpec full = checked(spec);
  check_places(full, context);
  if (full.run.cluster) ClusterBuild::check(full, commands_of(full), context);
  const std::string work = work_folder_of(full.run);
  // It may hold the locks.
  if (full.run.restart) {
    try {
      ClusterBuild::stop_merge_job(context.files, work, commands_of(full));
    } catch (const Error& error) {
      context.progress.warn(error.message() + "; tasks of it may still run");
    }
  }
  if (!full.run.cluster || !full.run.cluster->merge_job) return Build(full, context).run();
  MergeJob merge_job(full, work, context, commands_of(full));
  std::string id;
  const bool is_over = merge_job.finished() && !merge_job.has_left_work();
  if (full.run.restart || !(is_over || merge_job.is_alive()))
    id = Build(full, context).hand_over(merge_job);
  return merge_job.follow(id);
}

}  // namespace voxdag
