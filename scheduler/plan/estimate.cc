#include "scheduler/plan/estimate.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "scheduler/job/work_folder.h"
#include "scheduler/memory_plan.h"
#include "scheduler/plan/pilot.h"

namespace voxdag {
namespace {

// The growth of the DAG per doubling of R, above 2, falls by this factor per doubling: measured on
// Sponza (2.98 at 2048 to 2.58 at 131072) and the dragon (2.77 to 3.17 and back to 2.74).
constexpr double kGrowthDecay = 0.95;
// Each doubling away from the pilot widens the ranges of nodes and bytes by this factor.
constexpr double kSpreadPerDoubling = 1.12;
// Bytes per node of the global file: a pilot has fewer, since coarse levels repeat more.
constexpr double kMaxBytesPerNode = 23;
constexpr double kBytesGrowthPerDoubling = 1.04;
// Measured on real scenes: nodes of all artifacts over unique ones, their compressed bytes, and CPU
// time of a whole build over that of a pilot's nodes.
constexpr double kArtifactNodesPerUnique = 1.5;
constexpr double kArtifactBytesPerNode = 16;
// More than an uncompressed node takes, in an artifact or in the global file.
constexpr double kMaxDiskBytesPerNode = 40;
constexpr double kBuildOverPilotTime = 1.5;
// Peak memory of the merge per unique node, and memory of a process without a scene.
constexpr double kMemoryBytesPerNode = 34;
constexpr double kBaseMemoryBytes = 24e6;

EstimateRange exactly(double value) { return {value, value, value}; }
EstimateRange within(double value, double factor) {
  return {value / factor, value, value * factor};
}
EstimateRange operator+(const EstimateRange& a, const EstimateRange& b) {
  return {a.low + b.low, a.likely + b.likely, a.high + b.high};
}
EstimateRange operator*(double factor, const EstimateRange& a) {
  return {factor * a.low, factor * a.likely, factor * a.high};
}

// Pilots at up to three resolutions, a doubling apart, coarsest first.
std::vector<PilotCounts> build_pilots(const PreparedScene& scene, uint32_t pilot_levels,
                                      MemoryBudget& budget, const CancelToken& cancel) {
  const auto backend = make_cpu_backend();
  MemoryBudget share(MemoryPlan::pilot_bytes(budget.available()), &budget);
  std::vector<PilotCounts> pilots;
  const uint32_t finest = std::min(pilot_levels, scene.state.grid.levels);
  const uint32_t coarsest = std::max<uint32_t>(kMinGridLevels, finest < 4 ? 2 : finest - 2);
  for (uint32_t levels = coarsest; levels <= finest; ++levels) {
    const auto pilot =
        build_pilot(*scene.triangles, scene.state.grid.levels, levels, *backend, share, cancel);
    if (!pilot) break;  // the finer ones would not fit either
    pilots.push_back(*pilot);
  }
  return pilots;
}

// a R^2 + b R through the last two pilots, at `doublings` past the last.
double grow_as_surface(double coarse, double fine, uint32_t doublings) {
  const double ratio = std::exp2(doublings);
  const double square = 2 * (fine - 2 * coarse), linear = fine - square;  // of the fine pilot
  if (square <= 0) return fine * ratio * ratio;
  return std::max(square * ratio * ratio + linear * ratio, fine);
}

// Growth per doubling observed over the pilots (their geometric mean), falling from there.
double grow_as_dag(const std::vector<PilotCounts>& pilots, uint32_t doublings) {
  const double nodes = pilots.back().dag_nodes;
  if (pilots.size() < 2 || nodes == 0) return nodes * std::exp2(1.5 * doublings);
  const double steps = static_cast<double>(pilots.size() - 1);
  double growth = std::pow(nodes / std::max(pilots.front().dag_nodes, 1.0), 1 / steps);
  double result = nodes;
  for (uint32_t i = 0; i < doublings; ++i) {
    if (growth > 2) growth = 2 + (growth - 2) * kGrowthDecay;
    result *= growth;
  }
  return result;
}

// What must be spilled is spilled already. A large scene is also stored durably where the disk has
// space; it is freed piece by piece while artifacts are written.
EstimateRange triangles_on_disk(const PreparedScene& scene) {
  const double spilled = static_cast<double>(scene.triangles->file_bytes());
  return {spilled, std::max(spilled, scene.max_durable_bytes / 2),
          std::max(spilled, scene.max_durable_bytes)};
}

}  // namespace

Estimate estimate_build(const PreparedScene& scene, uint32_t pilot_levels, unsigned threads,
                        MemoryBudget& budget, const CancelToken& cancel) {
  Estimate estimate;
  estimate.triangles = scene.state.counts.triangles;
  estimate.subvolumes = scene.plan.size();
  estimate.free_memory = budget.limit();
  const auto pilots = build_pilots(scene, pilot_levels, budget, cancel);
  if (pilots.empty()) {
    // Too many triangles even for a small grid: their expected voxels are an upper bound.
    estimate.voxels = {0, scene.state.counts.expected_voxels, scene.state.counts.expected_voxels};
    return estimate;
  }
  const PilotCounts& last = pilots.back();
  const PilotCounts& before = pilots[pilots.size() > 1 ? pilots.size() - 2 : 0];
  const uint32_t doublings = scene.state.grid.levels - last.levels;
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
  const double triangle_bytes = static_cast<double>(scene.triangles->record_bytes()) *
                                static_cast<double>(scene.state.counts.triangles);
  estimate.memory_bytes = kMemoryBytesPerNode * estimate.dag_nodes + exactly(triangle_bytes);
  for (double* figure :
       {&estimate.memory_bytes.low, &estimate.memory_bytes.likely, &estimate.memory_bytes.high})
    *figure = std::min(*figure, static_cast<double>(budget.limit())) + kBaseMemoryBytes;
  const double growth = last.dag_nodes > 0 ? nodes / last.dag_nodes : 1;
  estimate.cpu_s = within(last.cpu_s * growth * kBuildOverPilotTime, 1.5 * spread);
  estimate.wall_s = (1.05 / std::max(1u, threads)) * estimate.cpu_s;
  return estimate;
}

double max_disk_bytes(const PreparedScene& scene) {
  // A triangle touches about A/4 + E/2 + 1 cubes for every A + E + 1 of half their edge
  // (expected_work()): over all levels twice its bricks, and one cube per level.
  double bricks = 0;
  for (const SubvolumePlan& subvolume : scene.plan) bricks += subvolume.weight;
  const double triangles = static_cast<double>(scene.state.counts.triangles);
  const double octree_nodes = 2 * bricks + scene.state.grid.levels * triangles;
  return kMaxDiskBytesPerNode * octree_nodes + triangles_on_disk(scene).high;
}

Estimate plan_build(const BuildSpec& spec, const BuildContext& context) {
  // A pilot of 2048^3 takes a second or two and holds for every resolution above.
  constexpr uint32_t kPilotLevels = 11;
  const BuildSpec full = checked(spec);
  return_freed_memory_to_system();
  MemoryBudget budget(full.run.memory_bytes);
  StageClock clock;
  const char* temporary = std::getenv("TMPDIR");
  std::string folder = full.run.work_folder;
  if (folder.empty())
    folder =
        std::string(temporary ? temporary : "/tmp") + "/voxdag-plan-" + std::to_string(getpid());
  WorkFolder work(context.files, folder);
  // Removes spilled triangles; a job in the given work folder stays as it is.
  struct Cleanup {
    WorkFolder& work;
    const bool own_folder;
    ~Cleanup() { own_folder ? work.remove() : work.remove_spilled(); }
  } cleanup{work, full.run.work_folder.empty()};
  IngestCheckpoint no_checkpoints(full, nullptr, work, context);
  const PreparedScene scene = prepare_scene(full, budget, clock, context, no_checkpoints);
  Estimate estimate = estimate_build(scene, kPilotLevels, full.run.threads, budget, context.cancel);
  estimate.free_disk = context.files.free_space(work.path());
  return estimate;
}

namespace {

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
  if (bytes.low > free_bytes)
    throw Error(ErrorCode::kNoSpace, need + ": free some, or build anyway with --force");
  if (bytes.high > free_bytes) progress.warn(need);
}

}  // namespace

void check_estimate(const Estimate& estimate, FileSystem& files, const std::string& work_folder,
                    const std::string& output_folder, Progress& progress) {
  const uint64_t work_free = files.free_space(work_folder);
  const uint64_t output_free = files.free_space(output_folder);
  // Equal to the byte: taken for one disk, which must hold everything.
  if (work_free == output_free) {
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

std::string estimate_json(const Estimate& e) {
  using nlohmann::ordered_json;
  const auto range = [](const EstimateRange& r) {
    return ordered_json{{"low", r.low}, {"likely", r.likely}, {"high", r.high}};
  };
  return ordered_json{
      {"triangles", e.triangles},
      {"subvolumes", e.subvolumes},
      {"pilot_resolution", e.pilot_resolution},
      {"voxels", range(e.voxels)},
      {"svo_nodes", range(e.svo_nodes)},
      {"dag_nodes", range(e.dag_nodes)},
      {"file_bytes", range(e.file_bytes)},
      {"disk_bytes", range(e.disk_bytes)},
      {"memory_bytes", range(e.memory_bytes)},
      {"cpu_s", range(e.cpu_s)},
      {"wall_s", range(e.wall_s)},
      {"free_disk_bytes", e.free_disk},
      {"memory_budget_bytes", e.free_memory},
  }
      .dump(2);
}

}  // namespace voxdag
