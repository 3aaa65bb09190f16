#include "scheduler/run_build.h"

#include <algorithm>
#include <thread>

#include "core/backend/backend.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/format/global_writer.h"
#include "merge/merge.h"
#include "scheduler/ingest.h"
#include "scheduler/memory_limits.h"
#include "scheduler/work_folder.h"

namespace voxdag {
namespace {

// Subvolumes are cut so that each is expected to touch at most this many bricks: a fraction of a
// second of work, and tables that stay in the caches.
constexpr double kMostBricksASubvolume = 4e6;
// ... but small builds are cut into at least about this many pieces, of at least this weight.
constexpr double kLeastPieces = 128;
constexpr double kLeastBricksASubvolume = 65536;
// More bins than this would make their buffers too small; finer cuts are made by splitting.
constexpr size_t kMostBins = 8192;

void check_spec(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  const auto refuse = [](const std::string& what) { throw Error(ErrorCode::kInvalidInput, what); };
  levels_of_resolution(g.resolution);
  if (g.scenes.empty()) refuse("no scene was given: expected at least one .glb or .gltf file");
  if (g.hash_bits < 4 || g.hash_bits > 64)
    refuse("hash bits " + std::to_string(g.hash_bits) + ": expected 4 to 64");
  if (g.bounds && g.voxel_size) refuse("bounds and a voxel size were both given: expected one");
  if (r.output.empty()) refuse("no output file was given");
  if (r.memory_bytes && r.memory_bytes < kLeastMemory)
    refuse("memory " + std::to_string(r.memory_bytes) + " bytes: expected at least 64 MiB");
  const uint64_t edge = r.subvolume_edge;
  if (edge && (edge & (edge - 1) || edge < static_cast<uint64_t>(kSmallestEdge)))
    refuse("subvolume edge " + std::to_string(edge) + ": expected a power of two from 64 voxels");
  if (r.backend != "auto" && r.backend != "cpu")
    throw Error(ErrorCode::kDevice,
                "backend '" + r.backend + "' is not in this build: expected auto or cpu");
}

// Times the stages of a build as they follow one another.
class StageClock {
 public:
  explicit StageClock(std::vector<StageTime>& stages) : stages_(stages) {}
  void finish(const std::string& name) {
    const double wall = wall_seconds(), cpu = process_cpu_seconds();
    stages_.push_back({name, wall - wall_, cpu - cpu_});
    wall_ = wall;
    cpu_ = cpu;
  }

 private:
  std::vector<StageTime>& stages_;
  double wall_ = wall_seconds();
  double cpu_ = process_cpu_seconds();
};

std::vector<SubvolumePlan> choose_subvolumes(const TopTree& top, const RunOptions& options) {
  if (options.subvolume_edge) {
    int64_t edge = static_cast<int64_t>(options.subvolume_edge);
    auto plan = top.subvolumes_by_edge(edge);
    while (plan.size() > kMostBins) plan = top.subvolumes_by_edge(edge *= 2);
    return plan;
  }
  double most =
      std::clamp(top.total_weight() / kLeastPieces, kLeastBricksASubvolume, kMostBricksASubvolume);
  auto plan = top.subvolumes_by_weight(most);
  while (plan.size() > kMostBins) plan = top.subvolumes_by_weight(most *= 2);
  return plan;
}

}  // namespace

BuildReport run_build(const BuildSpec& spec, const Seams& seams) {
  check_spec(spec);
  const double wall_start = wall_seconds();
  BuildReport report;
  report.output = spec.run.output;
  report.hash_bits = spec.geometry.hash_bits;
  report.threads =
      spec.run.threads ? spec.run.threads : std::max(1u, std::thread::hardware_concurrency());
  report.memory_bytes = spec.run.memory_bytes ? spec.run.memory_bytes : default_memory();
  StageClock clock(report.stages);
  MemoryBudget budget(report.memory_bytes);

  const auto scene = open_scene(seams.files, spec.geometry.scenes, {spec.geometry.skip_invalid},
                                budget, seams.cancel);
  report.grid = choose_grid(spec.geometry, *scene, seams);
  clock.finish("scan");

  WorkFolder work(seams.files,
                  spec.run.work_folder.empty() ? spec.run.output + ".work" : spec.run.work_folder);
  if (spec.run.keep_work) work.keep();
  MemoryBudget bins_share(budget.limit() / 3, &budget);
  TriangleBins bins(seams.files, work.spill_path(), spec.geometry.bounds.has_value(), bins_share);
  std::vector<QueuedSubvolume> queue;
  {
    TopTree top(report.grid.levels, TopTree::depth_within(report.grid.levels, budget.limit() / 16),
                budget);
    const BinId whole = bins.add_bin();
    const IngestCounts counts = ingest(*scene, report.grid, bins, whole, top, seams);
    report.triangles = counts.triangles;
    report.dropped_outside = counts.dropped_outside;
    report.dropped_invalid = scene->invalid_triangles();
    clock.finish("ingest");
    queue = hand_down(choose_subvolumes(top, spec.run), report.grid.levels, bins, whole,
                      budget.limit() / 8, seams.cancel);
  }
  clock.finish("distribute");

  ExecutorOptions options;
  options.grid_levels = report.grid.levels;
  options.hash_bits = report.hash_bits;
  options.threads = report.threads;
  if (spec.run.subvolume_edge) options.longest_edge = static_cast<int64_t>(spec.run.subvolume_edge);
  options.open_backend = [] { return make_cpu_backend(); };
  options.segment_folder = work.path();
  seams.progress.begin_stage("build", queue.size(), "subvolumes");
  const BuiltSubvolumes built = build_subvolumes(options, std::move(queue), bins, seams.files,
                                                 budget, seams.progress, seams.cancel);
  seams.progress.end_stage();
  report.subvolumes = built.built;
  report.subvolumes_split = built.split;
  report.artifact_bytes = built.artifact_bytes;
  report.artifact_nodes = built.artifact_nodes;
  clock.finish("build");

  GlobalFileWriter out(seams.files, spec.run.output, report.grid, report.hash_bits);
  MergeInputs inputs;
  inputs.grid_levels = report.grid.levels;
  inputs.hash_bits = report.hash_bits;
  inputs.artifacts = built.artifacts;
  inputs.open_segment = [&](uint32_t id) { return work.open_segment(id); };
  inputs.scratch_folder = work.scratch_path();
  const MergeReport merged = merge_sub_dags(inputs, seams.files, out, budget, report.threads,
                                            seams.progress, seams.cancel);
  report.voxels = merged.voxels;
  report.svo_nodes = merged.svo_nodes;
  report.dag_nodes = merged.dag_nodes;
  report.merge_rounds = merged.rounds;
  report.merge_ranges = merged.hash_ranges;
  report.spill_bytes = bins.spilled_bytes() + merged.scratch_bytes;
  clock.finish("merge");

  seams.progress.begin_stage("write", 0, "bytes");
  const GlobalFileSummary file = out.finish(merged.voxels, merged.svo_nodes);
  seams.progress.end_stage();
  report.bytes = file.bytes;
  report.sha256 = file.sha256;
  clock.finish("write");

  if (report.triangles == 0)
    seams.progress.warn("the scene has no triangles in the grid: the file has no nodes");
  report.wall_s = wall_seconds() - wall_start;
  report.cpu_s = process_cpu_seconds();
  report.peak_rss_bytes = peak_resident_bytes();
  write_file_atomically(seams.files, spec.run.output + ".report.json", report_json(report) + "\n");
  return report;
}

}  // namespace voxdag
