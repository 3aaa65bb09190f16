#include "scheduler/run_build.h"

#include <functional>
#include <set>
#include <utility>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/threads/kept_threads.h"
#include "core/fields/field.h"
#include "core/io/outputs/space_reserve.h"
#include "scheduler/check_spec.h"
#include "scheduler/cluster/advice_on_tasks.h"
#include "scheduler/cluster/cluster.h"
#include "scheduler/replaced_result.h"
#include "scheduler/solid/seed.h"
#include "scheduler/solid/solid_report.h"
#include "scheduler/spec/unbuildable_job.h"
#include "scheduler/stages/attributes/attribute_sections.h"
#include "scheduler/stages/build/thread_builder.h"
#include "scheduler/stages/enclose/enclose_stage.h"
#include "scheduler/stages/ingest/ingest_stage.h"
#include "scheduler/stages/merge/damaged_artifacts.h"
#include "scheduler/stages/merge/merge_stage.h"
#include "scheduler/stages/plan/estimate.h"
#include "scheduler/stages/publish/publish_stage.h"
#include "scheduler/stages/reorder/reorder_stage.h"
#include "scheduler/state/full_disk_advice.h"
#include "scheduler/state/job/empty_scene.h"

namespace voxdag {
namespace {

// Version of the formats of artifacts and job store, and of the rule for scene digests. A job with
// a different version is refused.
constexpr int64_t kWorkFormatVersion = 4;
// The scene is read at most kMaxReads times if stored triangles are damaged. The artifacts are
// merged at most kMaxMerges times if they are damaged.
constexpr int kMaxReads = 3, kMaxMerges = 3;

// Throws Error if the stored job has another format version or other geometry options. Called
// before the scene is read.
void refuse_other_options(const BuildJob& job) {
  const auto stored = job.store->job();
  if (!stored) return;
  if (stored->format_version != kWorkFormatVersion)
    job.refuse("its format version is " + std::to_string(stored->format_version) +
               ", this program's " + std::to_string(kWorkFormatVersion));
  const std::string requested = geometry_json(job.spec.geometry);
  if (stored->geometry != requested)
    job.refuse("its geometry options are " + stored->geometry + "; the requested options are " +
               requested);
}

// Prepares the work folder for this job. Removes the state of an earlier job if the build starts
// over; otherwise refuses an earlier job with another format version or other geometry options.
// Removes spilled triangles in either case.
void prepare_work_folder(BuildJob& job) {
  if (job.start_over) {
    job.checkpoint.forget();
    job.work.remove_colors();
    job.work.remove_merged();
    job.work.remove_rows();
    job.work.remove_filled();
    remove_tasks(job);
  } else {
    refuse_other_options(job);
  }
  job.work.remove_spilled();
}

// Called for a scene without triangles in the grid. Throws Error{kInvalidInput}, or only warns with
// --allow-empty. `declared` is the number of triangles that the scene's files declare.
void check_empty(BuildJob& job, uint64_t declared) {
  const BuildReport& report = job.report;
  std::string message =
      empty_scene_reason({declared, report.dropped_invalid, report.dropped_outside}, report.grid);
  const std::string scenes = joined(job.spec.geometry.scenes);
  if (!job.spec.run.allow_empty) {
    for (const Warning& warning : job.store->warnings()) message += "; " + warning.text();
    throw empty_scene_error(scenes + ": " + message);
  }
  job.context.progress.warn_of_input(
      {"empty-scene", scenes, message + "; the file will have no nodes"});
}

void report_scene(BuildJob& job, const IngestState& state) {
  BuildReport& report = job.report;
  report.grid = state.grid;
  report.triangles = state.counts.triangles;
  report.dropped_outside = state.counts.dropped_outside;
  report.dropped_invalid = state.counts.dropped_invalid;
  if (report.triangles == 0) check_empty(job, state.declared_triangles);
  seed_of(job.spec.geometry, report.grid);  // throws for a point outside the grid
}

// The plan stage: records the subvolumes in the job store. Resume rule: a stored job keeps its
// subvolumes, unless the scene's digest differs from the job's. Then the build is refused.
void plan(BuildJob& job, const PreparedScene& scene) {
  if (const auto stored = job.start_over ? std::nullopt : job.store->job()) {
    if (stored->scene_digest != scene.digest())
      job.refuse("its scene has different contents (digest " + stored->scene_digest.substr(0, 16) +
                 ", now " + scene.digest().substr(0, 16) + ")");
    return;
  }
  if (check_disk_space(job.spec, scene, job.scene, job.work.path(), job.budget, job.context))
    job.clock.finish("estimate");
  if (!job.work.was_empty()) {  // an earlier build may have had another scene
    job.work.remove_rows();
    job.work.remove_filled();
    job.work.remove_frame();
  }
  std::vector<StoredSubvolume> subvolumes(scene.plan.size());
  for (size_t i = 0; i < subvolumes.size(); ++i) {
    subvolumes[i].cube = scene.plan[i].cube;
    subvolumes[i].weight = scene.plan[i].weight;
  }
  job.store->start({scene.digest(), geometry_json(job.spec.geometry), kWorkFormatVersion},
                   subvolumes);
  job.start_over = false;
}

// Accepts subvolumes built by earlier runs. Then removes the segments that are named neither by the
// job store nor by one of the job's FilledParts objects.
void resume_subvolumes(BuildJob& job, SubvolumeBuilder& builder, const std::string& scene_digest) {
  builder.resume(scene_digest);
  if (!job.spec.run.cluster && !job.work.was_empty()) {
    accept_earlier_tasks(job, scene_digest);
    remove_tasks(job);
  }
  std::set<uint32_t> named;
  for (const StoredSubvolume& subvolume : job.store->leaves())
    if (subvolume.state == SubvolumeState::kBuilt) named.insert(subvolume.artifact.segment);
  job.work.remove_garbage([&](uint32_t segment) {
    bool is_named = named.contains(segment);
    for (const auto* parts : {&job.filled, &job.blocked, &job.closed})
      is_named = is_named || (*parts && (*parts)->names_segment(segment));
    return is_named;
  });
  if (!job.store->merge()) job.work.empty_scratch();
}

void report_artifacts(BuildJob& job) {
  const std::vector<StoredSubvolume> leaves = job.store->leaves();
  job.report.subvolumes = leaves.size();
  job.report.artifact_bytes = job.report.artifact_nodes = 0;
  for (const ArtifactRef& artifact : distinct_artifacts(leaves, job.work.store_path()))
    job.report.artifact_bytes += artifact.bytes;
  for (const StoredSubvolume& subvolume : leaves)
    job.report.artifact_nodes += subvolume.summary.dag_nodes;
}

// Opens the sample rows (SolidRows) of a solid or, with `--solid enclosed`, its filled parts
// (FilledParts). Loads their state if an earlier run saved it.
void open_solid(BuildJob& job, const std::string& scene_digest) {
  const GeometryOptions& geometry = job.spec.geometry;
  const std::string identity = scene_digest + " " + geometry_json(geometry);
  FileSystem& files = job.context.files;
  if (geometry.solid == SolidName::kEnclosed) {
    const auto open = [&](const std::string& path) {
      auto parts = std::make_unique<FilledParts>(files, path, identity);
      parts->load();
      return parts;
    };
    job.filled = open(job.work.filled_path());
    if (geometry.radius > 0) {
      job.blocked = open(job.work.blocked_path());
      job.closed = open(job.work.closed_path());
    }
  }
  const SolidRule rule = solid_rule_of(geometry);
  if (rule == SolidRule::kNone) return;
  job.rows = std::make_unique<SolidRows>(files, job.work.rows_path(), rule, job.report.grid.levels,
                                         identity);
  job.rows->load();
}

// Throws the first warning that an earlier run of the job recorded, if this build is strict: a
// strict build treats warnings about the scene as errors.
void refuse_stored_warnings(BuildJob& job) {
  if (!job.spec.run.strict) return;
  for (const Warning& warning : job.store->warnings()) refuse_warning(warning);
}

// Adds the numbers of a solid's interior voxels and sample rows to the report. Reports the warning
// of solid_warning(), if any. Does nothing if a merge job will wait for the subvolumes.
void report_solid(BuildJob& job) {
  if (!job.has_rows() || !job.planned().empty()) return;
  uint64_t interior = 0, disputed = 0;
  for (const StoredSubvolume& subvolume : job.store->leaves()) {
    interior += subvolume.summary.interior;
    disputed += subvolume.summary.disputed;
  }
  BuildReport& report = job.report;
  report.solid = solid_report(*job.rows, interior, disputed);
  if (const auto warning = solid_warning(*report.solid, job.spec.geometry.scenes.front()))
    job.context.progress.warn_of_input(*warning);
}

// Runs the stages scan, ingest, plan, partition and build, from the scene to all artifacts.
void read_and_build(BuildJob& job, SubvolumeBuilder& builder) {
  PreparedScene scene =
      prepare_scene(job.spec, job.scene, job.budget, job.clock, job.context, job.checkpoint);
  refuse_stored_warnings(job);
  report_scene(job, scene.state);
  plan(job, scene);
  open_solid(job, scene.digest());
  job.scene.close();  // frees its memory for the subvolumes
  resume_subvolumes(job, builder, scene.digest());
  job.context.progress.set_grid(job.report.grid.origin, job.report.grid.edge);
  const std::vector<StoredSubvolume> leaves = job.store->leaves();
  report_subvolumes(leaves, job.report.grid.levels, job.context.progress);
  const std::vector<StoredSubvolume> planned = job.planned();
  job.report.subvolumes_reused = leaves.size() - planned.size();
  const bool needs_rows = job.rows && !job.rows->is_ready();
  if (!planned.empty() || needs_rows) builder.build(scene, planned);
  builder.add_to(job.report);
  if (scene.triangles) job.report.spill_bytes += scene.triangles->file_bytes();
  report_artifacts(job);
  report_solid(job);
}

// Closes the segments before subvolumes are built again. First records the finished artifacts in
// the job store. Artifacts that cannot be recorded are discarded.
void close_segments(BuildJob& job) {
  job.scene.close();
  job.commit_best_effort();
  job.commits.clear();
  job.store->forget_built_in_memory();
}

// Builds the planned subvolumes. Reads the scene again if stored triangles are damaged, or if the
// disk is full and memory can hold the triangles.
void build_artifacts(BuildJob& job, SubvolumeBuilder& builder) {
  for (int read = 1;; ++read) {
    try {
      return read_and_build(job, builder);
    } catch (const DamagedTriangles& damage) {
      if (read >= kMaxReads) throw;
      job.context.progress.warn(damage.message() + "; the scene is read again");
      close_segments(job);
      job.checkpoint.forget();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNoSpace || !job.checkpoint.is_optional()) throw;
      job.context.progress.warn(error.message() + "; the scene is read again, into memory");
      close_segments(job);
      job.checkpoint.disable();
    }
  }
}

// Recovers from damage: plans subvolumes with damaged artifacts again. If no artifact is damaged, a
// file of the merge must be damaged, so the merge restarts. The merge restarts at most once:
// returns false if it has restarted before.
bool recover(BuildJob& job, const Error& damage, bool& has_restarted) {
  if (replan_damaged(job) > 0) return true;
  if (std::exchange(has_restarted, true)) return false;
  job.store->forget_merge();
  for (const auto* parts : {&job.filled, &job.blocked, &job.closed})
    if (*parts) (*parts)->forget();
  job.context.progress.warn("the merge restarts: " + damage.message());
  return true;
}

VoxelCounts voxel_counts(const BuildReport& report) {
  return {.voxels = report.merge.voxels, .svo_nodes = report.merge.svo_nodes};
}

// Writes the frame of the levels, so that the service can show the levels while the attributes are
// made.
void write_frame(BuildJob& job, const GlobalFileWriter& out) {
  if (!job.spec.geometry.attributes.any() || job.report.merge.voxels == 0) return;
  const GlobalFileFrame frame = out.frame(voxel_counts(job.report));
  job.work.write_frame(frame.header, frame.table);
}

// Runs the stages merge and reorder: writes all levels to `out`.
void write_levels(BuildJob& job, GlobalFileWriter& out) {
  job.work.remove_frame();  // it does not fit a file that is being written
  if (job.spec.geometry.order == OrderName::kHash) return merge_artifacts(job, out);
  GlobalFileWriter merged(job.context.files, job.work.merged_path(), job.report.grid,
                          job.report.hash_bits);
  merge_artifacts(job, merged);
  reorder_levels(job, merged, out);
}

uint64_t shell_voxels(const BuildJob& job) {
  uint64_t voxels = 0;
  for (const StoredSubvolume& subvolume : job.store->leaves()) voxels += subvolume.summary.voxels;
  return voxels;
}

// Completes the job's report and returns the text of its file.
std::string final_report(BuildJob& job, double start_s) {
  BuildReport& report = job.report;
  report.stages = job.clock.stages();
  report.warnings = job.store->warnings();
  if (job.filled) report.solid = enclosed_report(report.merge.voxels, shell_voxels(job));
  if (report.solid) report.solid->seed = job.spec.geometry.seed;
  if (report.solid && job.spec.geometry.radius > 0) report.solid->radius = job.spec.geometry.radius;
  if (report.solid) report.solid->volume = solid_volume(report.grid, report.merge.voxels);
  report.wall_s = wall_seconds() - start_s;
  report.cpu_s = process_cpu_seconds();
  report.peak_rss_bytes = peak_resident_bytes();
  return report_json(report) + "\n";
}

// Writes the report of a build whose output an earlier run published.
void write_report(BuildJob& job, double start_s) {
  const std::string text = final_report(job, start_s);
  if (const std::string path = report_path(job.spec.run); !path.empty())
    write_file_atomically(job.context.files, path, text);
}

// Runs the stages merge, reorder, attributes and publish, from the artifacts to the output file and
// its report. Returns false if it found damage and recover() succeeded. Then the caller must build
// the planned subvolumes and call this function again.
bool merge_and_publish(BuildJob& job, bool& has_restarted, double start_s) {
  AttributeSections attributes(job);
  if (is_published(job, attributes)) {
    job.work.remove_merged();
    write_report(job, start_s);
    return true;
  }
  bool reads_scene = false;  // if true, an error can come from the scene's files
  try {
    enclose(job);
    GlobalFileWriter out(job.context.files, job.report.output, job.report.grid,
                         job.report.hash_bits);
    write_levels(job, out);
    write_frame(job, out);
    reads_scene = true;
    attributes.add_to(out);
    reads_scene = false;
    publish(job, out, attributes, [&] { return final_report(job, start_s); });
    job.work.remove_merged();
    return true;
  } catch (const Error& error) {
    // DamagedTriangles reports damage of a spill file in the work folder, not of the scene. The
    // next call of this function writes a new spill file.
    const bool is_scratch = dynamic_cast<const DamagedTriangles*>(&error) != nullptr;
    if ((reads_scene && !is_scratch) || !error.is_corruption() ||
        !recover(job, error, has_restarted))
      throw;
    return false;
  }
}

// Repeats merge_and_publish() until the output is written. Builds subvolumes with damaged artifacts
// again.
void write_output(BuildJob& job, SubvolumeBuilder& builder, double start_s) {
  bool has_restarted = false;
  for (int run = 1; !merge_and_publish(job, has_restarted, start_s); ++run) {
    if (run == kMaxMerges)
      throw Error(ErrorCode::kCorrupt,
                  job.work.path() + ": files of built subvolumes were damaged " +
                      std::to_string(kMaxMerges) +
                      " times in a row: expected a disk that returns the written data");
    if (!job.planned().empty()) build_artifacts(job, builder);
  }
}

void remove_work(BuildJob& job) {
  job.progress.detach();
  job.commits.clear();
  remove_tasks(job);
  job.store.reset();
  job.work.remove();
}

void remove_finished_work(BuildJob& job) {
  if (!job.spec.run.keep_work) remove_work(job);
}

// Runs all stages of a build, and removes finished work (remove_finished_work()).
void run_stages(BuildJob& job, SubvolumeBuilder& builder, double start_s) {
  prepare_work_folder(job);
  build_artifacts(job, builder);
  if (job.spec.run.keep_work) job.commits.commit_in_background();
  write_output(job, builder, start_s);
  if (job.spec.run.keep_work) job.commits.commit();
  remove_finished_work(job);
}

// True if the work folder has something to resume: a job, or the checkpoint of a partly read scene
// that did not cause the error. In a cluster build, several processes share a job's folder.
bool is_worth_resuming(BuildJob& job, const Error& error) {
  if (dynamic_cast<const UnbuildableJob*>(&error) != nullptr && !job.spec.run.cluster) return false;
  const bool scene_is_at_fault =
      error.code() == ErrorCode::kInvalidInput || error.code() == ErrorCode::kLimit;
  return job.store->job() || (!scene_is_at_fault && job.checkpoint.has_saved());
}

std::string advice(const BuildJob& job, ErrorCode code) {
  if (code == ErrorCode::kNoSpace)
    return full_disk_advice(job.store->leaves(), job.spec.geometry.attributes.any());
  if (code == ErrorCode::kCanceled && job.spec.run.cluster)
    return "; its tasks run on: " + advice_on_tasks();
  if (code == ErrorCode::kCanceled) return "; " + repeat_text() + " to resume";
  return "";
}

// Runs `stages`. If they fail, keeps the finished work for the next run. If there is nothing to
// resume, removes the work folder.
void resumable(BuildJob& job, const std::function<void()>& stages) {
  try {
    stages();
  } catch (const Error& error) {
    job.commit_best_effort();
    if (!is_worth_resuming(job, error)) {
      remove_work(job);
      throw;
    }
    const Error reported(error.code(), error.message() + advice(job, error.code()));
    job.progress.record_failure(reported);
    throw reported;
  } catch (...) {
    job.commit_best_effort();
    throw;
  }
}

// Runs the build as the cluster's merge job. A job that was submitted twice, or restarted by Slurm,
// can find that the build is already finished.
void run_as_merge_job(BuildJob& job, double start_s) {
  const auto merge_job = make_merge_job(job.spec, job.scene.open(), job.context);
  if (const auto report = merge_job->finished()) {
    job.report = *report;
    return remove_finished_work(job);
  }
  job.report.merge_request = merge_job->request();
  run_stages(job, *make_cluster_builder(job), start_s);
}

BuildReport run_here(BuildJob& job, GuardedOutputs& files) {
  const double start_s = wall_seconds();
  resumable(job, [&] {
    check_changed_output(job, files);
    if (is_merge_job(job.spec)) return run_as_merge_job(job, start_s);
    if (job.spec.run.cluster) return run_stages(job, *make_cluster_builder(job), start_s);
    ThreadBuilder builder(job);
    run_stages(job, builder, start_s);
  });
  return job.report;
}

// Submits the tasks and the merge job. Returns the merge job's id, or "" if the merge job or its
// output already exists.
std::string submit_merge_job(BuildJob& job, MergeJob& merge_job, GuardedOutputs& files) {
  std::string id;
  resumable(job, [&] {
    check_changed_output(job, files);
    if (!job.start_over && merge_job.finished()) return remove_finished_work(job);
    if (!job.start_over && merge_job.is_alive()) return;
    merge_job.forget_finished();
    prepare_work_folder(job);
    const auto builder = make_cluster_builder(job);
    build_artifacts(job, *builder);
    id = builder->submit_merge_job();
  });
  return id;
}

}  // namespace

BuildReport run_build(const BuildSpec& requested, const BuildContext& caller) {
  const KeptThreads threads;
  const BuildSpec spec = checked(with_resolution(requested, caller));
  SpaceReserve reserve(caller.files, spec.run.min_free_bytes);
  GuardedOutputs files(reserve);
  guard_outputs(files, spec.run);
  const BuildContext context{files, caller.progress, caller.cancel};
  MemoryBudget budget(spec.run.memory_bytes);
  BuildScene scene(spec.geometry, work_folder_of(spec.run), budget, context);
  check_places(spec, scene, context);
  if (spec.run.cluster) check_cluster(spec, context);
  if (spec.run.restart) stop_earlier_merge_job(spec, context);
  if (!spec.run.cluster || !spec.run.cluster->merge_job) {
    BuildJob job(spec, scene, budget, context);
    return run_here(job, files);
  }
  const auto merge_job = make_merge_job(spec, scene.open(), context);
  std::string id;
  const bool is_over = merge_job->finished() && !merge_job->has_remaining_work();
  if (spec.run.restart || !(is_over || merge_job->is_alive())) {
    BuildJob job(spec, scene, budget, context);
    id = submit_merge_job(job, *merge_job, files);
  }
  scene.close();
  return merge_job->follow(id);
}

}  // namespace voxdag
