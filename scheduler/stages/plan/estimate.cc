#include "scheduler/stages/plan/estimate.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/plan/pilot_triangles.h"

namespace voxdag {
namespace {

// The growth of a DAG is the factor by which its number of nodes increases when R doubles. The
// growth's excess over kLateGrowth is multiplied by kGrowthDecay with each doubling. Measured
// growth: Sponza 2.72 at R = 8192, 2.52 at 524288; the dragon 3.17 at 8192, 2.75 at 32768, and 2.65
// on average up to 262144. At coarser resolutions the growth falls and rises again while triangles
// become larger than bricks, so pilots must be fine.
constexpr double kLateGrowth = 2.5;
constexpr double kGrowthDecay = 0.75;
// Each doubling away from the pilot widens the ranges of nodes and bytes by this factor.
constexpr double kSpreadPerDoubling = 1.12;
// Bytes of the global file per node. A pilot's file has fewer bytes per node, because coarse levels
// repeat more. So its number is multiplied by kBytesGrowthPerDoubling with each doubling of R, up
// to kMaxBytesPerNode.
constexpr double kMaxBytesPerNode = 23;
constexpr double kBytesGrowthPerDoubling = 1.04;
// Measured on real scenes: nodes of all artifacts per node of the global DAG, and compressed bytes
// of an artifact per node.
constexpr double kArtifactNodesPerUnique = 1.5;
constexpr double kArtifactBytesPerNode = 16;
// Upper bound of the bytes of a node, in an artifact or in the global file. An uncompressed node
// takes fewer.
constexpr double kMaxDiskBytesPerNode = 40;
// CPU time per DAG node of a build, relative to its pilot. Measured on real scenes.
constexpr double kBuildOverPilotTime = 1.5;
// Upper bound of the cells per brick. A surface that crosses a brick sets about 16 of its voxels.
constexpr double kMaxCellsPerBrick = 32;
// Peak memory of the merge per node of the global DAG, and memory of a process without a scene.
constexpr double kMemoryBytesPerNode = 26;
constexpr double kBaseMemoryBytes = 24e6;

// Returns the number of grid levels of the finer of the two pilots. Large builds are extrapolated
// from 13 levels (8192^3 voxels). This pilot takes one or two seconds. If the triangles do not fit
// in memory on this grid, they are read again for a coarser pilot.
uint32_t pilot_levels_of(uint32_t grid_levels) {
  return std::clamp<uint32_t>(grid_levels - std::min<uint32_t>(grid_levels, 2), 12, 13);
}

// Results of a pilot build. A pilot builds the complete scene as one subvolume on a coarser grid;
// its output is counted and discarded.
struct PilotCounts {
  uint32_t levels = 0;  // levels of the pilot's grid
  double voxels = 0;
  double svo_nodes = 0;
  double dag_nodes = 0;
  double file_bytes = 0;  // size of the pilot's global file, which is not written
  double cpu_s = 0;
};

class CountingSink : public SubDagSink {
 public:
  void bricks(const BrickLevelView& level) override { words += 2 * level.masks.size(); }
  void nodes(const NodeLevelView& level) override {
    words += level.masks.size() + level.children.size();
  }
  uint64_t words = 0;
};

// Builds a pilot of 2^levels voxels per edge. `triangles` are snapped to a grid that is finer by
// `shift` levels (0: to the pilot's grid). Returns nullopt if the build does not fit the budget.
std::optional<PilotCounts> build_pilot(const PilotTriangles& triangles, uint32_t shift,
                                       uint32_t levels, VoxelRule rule, Backend& backend,
                                       MemoryBudget& budget, const CancelToken& cancel) {
  const double start = thread_cpu_seconds();
  const auto stream = triangles.open(shift);
  CountingSink sink;
  SubDagSummary summary;
  if (backend.build({levels, Cube{}, 64, nullptr, rule}, *stream, budget, cancel, sink, summary) ==
      BuildOutcome::kNeedsSplit)
    return std::nullopt;
  PilotCounts counts;
  counts.levels = levels;
  counts.voxels = static_cast<double>(summary.voxels);
  counts.svo_nodes = static_cast<double>(summary.svo_nodes);
  counts.dag_nodes = static_cast<double>(summary.dag_nodes);
  counts.file_bytes = 4.0 * static_cast<double>(sink.words);
  counts.cpu_s = thread_cpu_seconds() - start + triangles.cpu_s();
  return counts;
}

// Runs pilots at two consecutive resolutions, the finest whose triangles and tables fit the budget.
// Returns the coarser pilot first. Returns fewer than two pilots if too many resolutions do not
// fit.
std::vector<PilotCounts> build_pilots(const PreparedScene& scene, uint32_t pilot_levels,
                                      VoxelRule rule, const StageContext& context) {
  const auto backend = make_cpu_backend();
  MemoryBudget share(MemoryPlan::pilot_bytes(context.budget.available()), &context.budget);
  MemoryBudget triangle_share(share.limit() / 2, &share);
  const uint32_t grid_levels = scene.state.grid.levels;
  const uint32_t finest = std::min(pilot_levels, grid_levels);
  const uint32_t coarsest = std::max<uint32_t>(kMinGridLevels, finest - std::min(finest, 4u));
  std::vector<PilotCounts> pilots;
  std::optional<PilotTriangles> triangles;
  uint32_t triangle_levels = finest;
  for (uint32_t levels = finest; levels >= coarsest && pilots.size() < 2; --levels) {
    if (!triangles || !triangles->is_complete()) {
      triangles.emplace(*scene.triangles, grid_levels - levels, triangle_share, context);
      triangle_levels = levels;
    }
    if (!triangles->is_complete()) continue;
    const auto pilot = build_pilot(*triangles, triangle_levels - levels, levels, rule, *backend,
                                   share, context.build.cancel);
    if (pilot) pilots.insert(pilots.begin(), *pilot);
  }
  return pilots;
}

// Extrapolates a count that grows as a R^2 + b R. `coarse` and `fine` are the counts of the two
// pilots, which determine a and b. `doublings` is the number of doublings of R from the finer
// pilot, negative for halvings.
double grow_as_surface(double coarse, double fine, int doublings) {
  const double ratio = std::exp2(doublings);
  const double square = 2 * (fine - 2 * coarse),
               linear = fine - square;  // a R^2 and b R at the fine pilot
  if (square <= 0) return fine * ratio * ratio;
  const double grown = square * ratio * ratio + linear * ratio;
  return doublings < 0 ? std::max(grown, 1.0) : std::max(grown, fine);
}

// Extrapolates the number of DAG nodes by a number of doublings of R from the last pilot. Starts
// with the growth between the last two pilots, and reduces the growth's excess over kLateGrowth
// with each doubling.
double grow_as_dag(const std::vector<PilotCounts>& pilots, int doublings) {
  const double nodes = pilots.back().dag_nodes;
  if (pilots.size() < 2 || nodes == 0) return nodes * std::exp2(1.5 * doublings);
  double growth = nodes / std::max(pilots[pilots.size() - 2].dag_nodes, 1.0);
  double result = nodes;
  for (int i = 0; i < doublings; ++i) {
    if (growth > kLateGrowth) growth = kLateGrowth + (growth - kLateGrowth) * kGrowthDecay;
    result *= growth;
  }
  return result;
}

// Returns the peak disk space of the triangles. Triangles that do not fit in memory are already
// spilled. A large scene is also stored durably if the disk has space; this copy is freed gradually
// while artifacts are written.
EstimateRange triangles_on_disk(const PreparedScene& scene) {
  const double spilled = static_cast<double>(scene.triangles->file_bytes());
  return {spilled, std::max(spilled, scene.max_disk_bytes / 2),
          std::max(spilled, scene.max_disk_bytes)};
}

void add_colors(const ColorEstimate& colors, Estimate& estimate) {
  estimate.colors = colors;
  estimate.file_bytes = estimate.file_bytes + colors.file_bytes;
  estimate.disk_bytes = estimate.disk_bytes + colors.disk_bytes();
  const EstimateRange memory = colors.memory_bytes + exactly(kBaseMemoryBytes);
  estimate.memory_bytes = {std::max(estimate.memory_bytes.low, memory.low),
                           std::max(estimate.memory_bytes.likely, memory.likely),
                           std::max(estimate.memory_bytes.high, memory.high)};
  estimate.cpu_s = estimate.cpu_s + colors.cpu_s;
}

// Returns an upper bound of the disk space of a build, without pilots. It is several times the
// actual size.
double max_disk_bytes(const GeometryOptions& options, const PreparedScene& scene,
                      BuildScene& source, const StageContext& context) {
  // A triangle touches about A + E + 1 cubes, where A follows from its area and E from its extents
  // (see expected_work()). So it touches about A/4 + E/2 + 1 cubes of twice the edge. The sum over
  // all levels is at most twice the number of its bricks, plus one cube per level.
  double bricks = 0;
  for (const SubvolumePlan& subvolume : scene.plan) bricks += subvolume.weight;
  const double triangles = static_cast<double>(scene.state.counts.triangles);
  const double octree_nodes = 2 * bricks + scene.state.grid.levels * triangles;
  const double geometry = kMaxDiskBytesPerNode * octree_nodes + triangles_on_disk(scene).high;
  if (!options.attributes.any()) return geometry;
  const uint32_t color_levels = levels_of_resolution(options.color_resolution);
  const double cells =
      kMaxCellsPerBrick * bricks * std::exp2(-2.0 * (scene.state.grid.levels - color_levels)) +
      triangles;
  return geometry +
         estimate_colors(options, source, exactly(cells), scene.state.counts.triangles, context)
             .disk_bytes()
             .high;
}

void check_disk(const char* what, const EstimateRange& bytes, const std::string& folder,
                uint64_t free, Progress& progress) {
  const auto gigabytes = [](double count) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f GB", count / 1e9);
    return std::string(text);
  };
  const double free_bytes = static_cast<double>(free);
  const std::string need = std::string(what) + " is estimated to need " + gigabytes(bytes.low) +
                           " to " + gigabytes(bytes.high) + " of disk at its peak, " + folder +
                           " has " + gigabytes(free_bytes) + " free";
  if (bytes.low > free_bytes) throw DoesNotFit(need + ": expected more free space");
  if (bytes.high > free_bytes) progress.warn(need);
}

// Compares the estimate with the free space on the disks of the work folder and the output folder.
// Throws Error{kNoSpace} with the estimate if even the low end does not fit. Warns if the high end
// does not fit.
void check_estimate(const Estimate& estimate, FileSystem& files, const std::string& work_folder,
                    const std::string& output_folder, Progress& progress) {
  const uint64_t work_free = files.free_space(work_folder);
  const uint64_t output_free = files.free_space(output_folder);
  if (files.device(work_folder) == files.device(output_folder)) {
    check_disk("the build", estimate.disk_bytes, work_folder, work_free, progress);
    return;
  }
  const EstimateRange& all = estimate.disk_bytes;
  const EstimateRange& file = estimate.file_bytes;
  check_disk("the build's work folder",
             {all.low - file.low, all.likely - file.likely, all.high - file.high}, work_folder,
             work_free, progress);
  check_disk("the global file", file, output_folder, output_free, progress);
}

}  // namespace

Estimate estimate_build(const GeometryOptions& options, const PreparedScene& scene,
                        BuildScene& source, const StageContext& context) {
  const MemoryBudget& budget = context.budget;
  Estimate estimate;
  estimate.triangles = scene.state.counts.triangles;
  estimate.subvolumes = scene.plan.size();
  for (const SubvolumePlan& subvolume : scene.plan) estimate.expected_bricks += subvolume.weight;
  estimate.free_memory = budget.limit();
  const auto pilots =
      build_pilots(scene, pilot_levels_of(scene.state.grid.levels), options.rule(), context);
  if (pilots.empty()) {
    // There are too many triangles even for a small grid. Their expected voxels are an upper bound.
    estimate.voxels = {0, scene.state.counts.expected_voxels, scene.state.counts.expected_voxels};
    return estimate;
  }
  const PilotCounts& last = pilots.back();
  const PilotCounts& before = pilots[pilots.size() > 1 ? pilots.size() - 2 : 0];
  const int doublings = static_cast<int>(scene.state.grid.levels - last.levels);
  estimate.pilot_resolution = uint64_t{1} << last.levels;

  const double surface_spread = 1 + 0.02 * doublings;
  const double spread = std::pow(kSpreadPerDoubling, doublings);
  estimate.voxels = within(grow_as_surface(before.voxels, last.voxels, doublings), surface_spread);
  estimate.svo_nodes =
      within(grow_as_surface(before.svo_nodes, last.svo_nodes, doublings), surface_spread);
  const double nodes = std::min(grow_as_dag(pilots, doublings), estimate.svo_nodes.likely);
  estimate.dag_nodes = within(nodes, spread);
  const double pilot_bytes = last.dag_nodes > 0 ? last.file_bytes / last.dag_nodes : 0;
  const double bytes = std::max(
      pilot_bytes,
      std::min(pilot_bytes * std::pow(kBytesGrowthPerDoubling, doublings), kMaxBytesPerNode));
  estimate.file_bytes = bytes * estimate.dag_nodes + exactly(8192);

  const EstimateRange artifact_nodes = kArtifactNodesPerUnique * estimate.dag_nodes;
  estimate.disk_bytes =
      estimate.file_bytes + kArtifactBytesPerNode * artifact_nodes + triangles_on_disk(scene);
  // With cutouts, patches can replace a triangle, so there can be more records than triangles.
  const uint64_t records =
      std::max(scene.state.counts.triangles, scene.triangles->count(kSceneBin));
  const double triangle_bytes =
      static_cast<double>(scene.triangles->record_bytes()) * static_cast<double>(records);
  estimate.memory_bytes = kMemoryBytesPerNode * estimate.dag_nodes + exactly(triangle_bytes);
  for (double* figure :
       {&estimate.memory_bytes.low, &estimate.memory_bytes.likely, &estimate.memory_bytes.high})
    *figure = std::min(*figure, static_cast<double>(budget.limit())) + kBaseMemoryBytes;
  const double growth = last.dag_nodes > 0 ? nodes / last.dag_nodes : 1;
  estimate.cpu_s = within(last.cpu_s * growth * kBuildOverPilotTime, 1.5 * spread);
  if (options.attributes.any()) {
    const int color_doublings = static_cast<int>(levels_of_resolution(options.color_resolution)) -
                                static_cast<int>(last.levels);
    const EstimateRange cells = within(grow_as_surface(before.voxels, last.voxels, color_doublings),
                                       1.02 + 0.02 * std::abs(color_doublings));
    add_colors(estimate_colors(options, source, cells, estimate.triangles, context), estimate);
  }
  estimate.wall_s = (1.05 / std::max(1u, context.threads)) * estimate.cpu_s;
  return estimate;
}

bool check_disk_space(const BuildSpec& spec, const PreparedScene& scene, BuildScene& source,
                      const std::string& work_folder, MemoryBudget& budget,
                      const BuildContext& context) {
  if (spec.run.force) return false;
  const std::string output_folder = parent_directory(spec.run.output);
  const uint64_t free_bytes =
      std::min(context.files.free_space(work_folder), context.files.free_space(output_folder));
  const StageContext stage{context, spec.run.threads, budget};
  if (max_disk_bytes(spec.geometry, scene, source, stage) < static_cast<double>(free_bytes))
    return false;
  const Estimate estimate = estimate_build(spec.geometry, scene, source, stage);
  check_estimate(estimate, context.files, work_folder, output_folder, context.progress);
  return true;
}

std::string estimate_json(const Estimate& e) {
  using nlohmann::ordered_json;
  ordered_json json = {
      {"triangles", e.triangles},
      {"subvolumes", e.subvolumes},
      {"pilot_resolution", e.pilot_resolution},
      {"voxels", count_json(e.voxels)},
      {"svo_nodes", count_json(e.svo_nodes)},
      {"dag_nodes", count_json(e.dag_nodes)},
      {"file_bytes", count_json(e.file_bytes)},
      {"disk_bytes", count_json(e.disk_bytes)},
      {"memory_bytes", count_json(e.memory_bytes)},
      {"cpu_s", range_json(e.cpu_s)},
      {"wall_s", range_json(e.wall_s)},
      {"free_disk_bytes", e.free_disk},
      {"memory_budget_bytes", e.free_memory},
  };
  if (const auto& c = e.colors)
    json["colors"] = {{"cells", count_json(c->cells)},
                      {"file_bytes", count_json(c->file_bytes)},
                      {"artifact_bytes", count_json(c->artifact_bytes)},
                      {"spill_bytes", count_json(c->spill_bytes)},
                      {"cpu_s", range_json(c->cpu_s)}};
  return json.dump(2);
}

}  // namespace voxdag
