#include "scheduler/run_build.h"

#include "core/backend/backend.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/format/global_writer.h"
#include "merge/merge.h"
#include "scheduler/estimate.h"
#include "scheduler/memory_limits.h"
#include "scheduler/prepare.h"
#include "scheduler/work_folder.h"

namespace voxdag {
namespace {

// Below this resolution a build fits any disk that can hold its scene: no estimate is made.
constexpr uint32_t kLevelsWorthAnEstimate = 12;
// The pilot of the check before a build is this much coarser, so that it costs next to nothing.
constexpr uint32_t kLevelsBelowForTheCheck = 5;

// One build, stage by stage.
class Build {
 public:
  Build(const BuildSpec& spec, const Seams& seams)
      : spec_(checked(spec)),
        seams_(seams),
        budget_(spec_.run.memory_bytes),
        work_(seams.files,
              spec_.run.work_folder.empty() ? spec_.run.output + ".work" : spec_.run.work_folder) {
    if (spec_.run.keep_work) work_.keep();
    report_.output = spec_.run.output;
    report_.hash_bits = spec_.geometry.hash_bits;
    report_.threads = spec_.run.threads;
    report_.memory_bytes = spec_.run.memory_bytes;
  }

  BuildReport run() {
    const double start = wall_seconds();
    const std::vector<ArtifactRef> artifacts = build();
    GlobalFileWriter out(seams_.files, spec_.run.output, report_.grid, report_.hash_bits);
    merge(artifacts, out);
    write(out);
    report_.stages = clock_.stages();
    report_.wall_s = wall_seconds() - start;
    report_.cpu_s = process_cpu_seconds();
    report_.peak_rss_bytes = peak_resident_bytes();
    write_file_atomically(seams_.files, spec_.run.output + ".report.json",
                          report_json(report_) + "\n");
    return report_;
  }

 private:
  // Scan, ingest, and all subvolumes; what they hold in memory is gone when it returns.
  std::vector<ArtifactRef> build() {
    PreparedScene scene = prepare_scene(spec_, work_.spill_path(), budget_, clock_, seams_);
    report_.grid = scene.grid;
    report_.triangles = scene.counts.triangles;
    report_.dropped_outside = scene.counts.dropped_outside;
    report_.dropped_invalid = scene.dropped_invalid;
    if (report_.triangles == 0)
      seams_.progress.warn("the scene has no triangles in the grid: the file will have no nodes");
    check_room(scene);

    const uint32_t levels = scene.grid.levels;
    std::vector<QueuedSubvolume> queue =
        hand_down(scene.plan, levels, *scene.bins, scene.whole, budget_.limit() / 8, seams_.cancel);
    clock_.finish("distribute");
    ExecutorOptions options;
    options.grid_levels = levels;
    options.hash_bits = spec_.geometry.hash_bits;
    options.threads = spec_.run.threads;
    if (spec_.run.subvolume_edge)
      options.longest_edge = static_cast<int64_t>(spec_.run.subvolume_edge);
    options.open_backend = [] { return make_cpu_backend(); };
    options.segment_folder = work_.path();
    seams_.progress.begin_stage("build", queue.size(), "subvolumes");
    BuiltSubvolumes built = build_subvolumes(options, std::move(queue), *scene.bins, seams_.files,
                                             budget_, seams_.progress, seams_.cancel);
    seams_.progress.end_stage();
    report_.subvolumes = built.built;
    report_.subvolumes_split = built.split;
    report_.artifact_bytes = built.artifact_bytes;
    report_.artifact_nodes = built.artifact_nodes;
    report_.spill_bytes = scene.bins->spilled_bytes();
    clock_.finish("build");
    return std::move(built.artifacts);
  }

  // Refuses a build that cannot fit before any work is done.
  void check_room(const PreparedScene& scene) {
    if (spec_.run.force || scene.grid.levels < kLevelsWorthAnEstimate) return;
    const Estimate estimate = estimate_build(scene, scene.grid.levels - kLevelsBelowForTheCheck,
                                             spec_.run.threads, budget_, seams_.cancel);
    check_estimate(estimate, seams_.files, work_.path(), seams_.progress);
    clock_.finish("estimate");
  }

  void merge(const std::vector<ArtifactRef>& artifacts, GlobalFileWriter& out) {
    MergeInputs inputs;
    inputs.grid_levels = report_.grid.levels;
    inputs.hash_bits = report_.hash_bits;
    inputs.artifacts = artifacts;
    inputs.open_segment = [&](uint32_t id) { return work_.open_segment(id); };
    inputs.scratch_folder = work_.scratch_path();
    const MergeReport merged = merge_sub_dags(inputs, seams_.files, out, budget_, spec_.run.threads,
                                              seams_.progress, seams_.cancel);
    report_.voxels = merged.voxels;
    report_.svo_nodes = merged.svo_nodes;
    report_.dag_nodes = merged.dag_nodes;
    report_.merge_rounds = merged.rounds;
    report_.merge_ranges = merged.hash_ranges;
    report_.merge_streamed_groups = merged.streamed_groups;
    report_.spill_bytes += merged.scratch_bytes;
    clock_.finish("merge");
  }

  void write(GlobalFileWriter& out) {
    const GlobalFileSummary file = out.finish(report_.voxels, report_.svo_nodes);
    report_.bytes = file.bytes;
    report_.sha256 = file.sha256;
    clock_.finish("write");
  }

  const BuildSpec spec_;
  const Seams& seams_;
  StageClock clock_;
  MemoryBudget budget_;
  WorkFolder work_;
  BuildReport report_;
};

}  // namespace

BuildReport run_build(const BuildSpec& spec, const Seams& seams) {
  if (spec.run.output.empty())
    throw Error(ErrorCode::kInvalidInput, "no output file was given: expected a path (-o)");
  return Build(spec, seams).run();
}

}  // namespace voxdag
