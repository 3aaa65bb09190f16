#include "scheduler/stages/plan/estimate.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/dag/brick.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/format/artifact/artifact.h"
#include "core/format/global/global_layout.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/solid/solid_report.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/plan/pilots.h"
#include "scheduler/stages/plan/subvolume_costs.h"

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
// The finer the grid, the more bytes per node the global file has. So the estimate multiplies the
// bytes per node of the pilot's file by kBytesGrowthPerDoubling with each doubling of R. The result
// is at most kMaxBytesPerNode.
constexpr double kMaxBytesPerNode = 23;
constexpr double kBytesGrowthPerDoubling = 1.04;
// Upper bound of the bytes of a node, in an artifact or in the global file. Even an uncompressed
// node takes fewer bytes.
constexpr double kMaxDiskBytesPerNode = 40;
// CPU time per DAG node of a build, divided by the CPU time per DAG node of its pilot. Measured on
// real scenes.
constexpr double kBuildOverPilotTime = 1.5;
// CPU time of a build that reorders its nodes, divided by the time of a build without reordering.
constexpr double kReorderTime = 1.3;
// Upper bound of the cells per brick. A surface that crosses a brick sets about 16 of its voxels.
constexpr double kMaxCellsPerBrick = 32;
// Bytes of the work files with sample rows, per byte of the uncompressed rows. Measured on real
// scenes.
constexpr EstimateRange kRowFilesOverRows = {0.02, 0.1, 0.5};
// Memory for filling a part of an enclosed solid, per node of the part.
constexpr double kEncloseBytesPerNode = 150;
// Copies of the triangles in memory. The partition reads the stored triangles and stores them
// again, and the memory of both is in use, or not yet returned to the system, at the peak.
// Measured: 2.0. The rest is for the memory of the workers.
constexpr double kTriangleCopies = 2.4;
// Peak memory per node of the global DAG, if a hash partition of the merge has the rows of a
// complete level. This is so for the first kNodesOfAPartition nodes, and for more nodes if the
// subvolumes are small (LevelRows). Otherwise further nodes need less memory. How much depends on
// how many nodes occur in several subvolumes, and on the tables of the largest subvolumes.
constexpr double kMemoryBytesPerNode = 26;
constexpr double kNodesOfAPartition = 5e6;
constexpr EstimateRange kMemoryBytesPerFurtherNode = {5, 9, 14};
// The largest level's share of the rows of all artifacts.
constexpr double kLargestLevelShare = 0.4;
// Memory of a process without a scene.
constexpr double kBaseMemoryBytes = 24e6;

// Returns the peak memory of the stages build and merge for a DAG with this number of nodes, whose
// `subvolumes` artifacts have `artifact_nodes` nodes.
EstimateRange memory_of_nodes(const EstimateRange& nodes, double artifact_nodes,
                              double subvolumes) {
  const double frames = std::max(1.0, kLargestLevelShare * artifact_nodes / kFrameRows);
  const double frames_per_run = frames / std::clamp(subvolumes, 1.0, frames);
  // The part of a level in one partition, as in LevelRows::useful_bytes().
  const double part = std::min(1.0, 1 / (1 + frames_per_run / 4) + 1 / frames_per_run);
  const auto memory = [part](double count, double per_further_node) {
    const double first = std::min(count, kNodesOfAPartition);
    return std::max(kMemoryBytesPerNode * first + per_further_node * (count - first),
                    kMemoryBytesPerNode * count * part);
  };
  const EstimateRange& further = kMemoryBytesPerFurtherNode;
  return {memory(nodes.low, further.low), memory(nodes.likely, further.likely),
          memory(nodes.high, further.high)};
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

// Extrapolates a count of a solid, which grows as a R^3 + b R^2: a R^3 for the volume of the
// interior, b R^2 for the area of surfaces.
double grow_as_volume(double coarse, double fine, int doublings) {
  const double ratio = std::exp2(doublings);
  // a R^3 and b R^2 at the fine pilot.
  const double cube = 2 * (fine - 4 * coarse), square = fine - cube;
  if (cube <= 0) return grow_as_surface(coarse, fine, doublings);
  return std::max((cube * ratio + square) * ratio * ratio, fine);
}

// Extrapolates a number of voxels or octree nodes.
EstimateRange grow_count(double PilotCounts::*count, const std::vector<PilotCounts>& pilots,
                         bool is_solid, int doublings) {
  const double fine = pilots.back().*count;
  const double coarse = pilots[pilots.size() > 1 ? pilots.size() - 2 : 0].*count;
  if (is_solid) return within(grow_as_volume(coarse, fine, doublings), 1 + 0.05 * doublings);
  return within(grow_as_surface(coarse, fine, doublings), 1 + 0.02 * doublings);
}

// Extrapolates the number of DAG nodes of the last pilot to a resolution that is 2^doublings times
// as high. Starts with the growth between the last two pilots, and reduces the growth's excess over
// kLateGrowth with each doubling.
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

// Bytes of the sample rows of all subvolumes, and of the largest subvolume.
struct PlannedRows {
  double all = 0, largest = 0;
};
PlannedRows planned_rows(const PreparedScene& scene) {
  PlannedRows rows;
  for (const SubvolumePlan& subvolume : scene.plan) {
    const auto bytes = static_cast<double>(row_bytes(subvolume.cube, scene.state.grid.levels));
    rows.all += bytes;
    rows.largest = std::max(rows.largest, bytes);
  }
  return rows;
}

// Returns the number of sets of artifacts that the work folder stores for an enclosed solid in
// addition to the artifacts of its shell. One set is the filled solid. With a radius, the blocked
// and the closed positions are two more sets. All sets take about the same space.
double artifact_copies(const GeometryOptions& options) { return options.radius > 0 ? 3 : 1; }

// The disk space and the memory that only a solid needs.
struct SolidNeeds {
  EstimateRange disk_bytes, memory_bytes;
};
SolidNeeds solid_needs(const GeometryOptions& options, const PreparedScene& scene,
                       const SubvolumeCosts& costs, const StageContext& context) {
  const unsigned threads = context.threads;
  if (solid_rule_of(options) != SolidRule::kNone) {
    const PlannedRows rows = planned_rows(scene);
    return {rows.all * kRowFilesOverRows, exactly(2 * rows.largest * threads)};
  }
  const double subvolumes = static_cast<double>(std::max<size_t>(scene.plan.size(), 1));
  const bool keeps_labels = MemoryPlan::kept_label_bytes(context.budget.limit()) != 0;
  const double in_memory = keeps_labels ? 1 : std::min(1.0, threads / subvolumes);
  return {artifact_copies(options) * costs.artifact_bytes,
          kEncloseBytesPerNode * in_memory * costs.artifact_nodes};
}

// Extrapolates the interior of a solid. Copies the counts of sample rows from the finer pilot.
SolidEstimate estimate_solid(const GeometryOptions& options, const std::vector<PilotCounts>& pilots,
                             int doublings) {
  const PilotCounts& last = pilots.back();
  SolidEstimate solid;
  solid.rule = name_of(options.solid);
  solid.interior = grow_count(&PilotCounts::interior, pilots, true, doublings);
  solid.disputed = grow_count(&PilotCounts::disputed, pilots, true, doublings);
  solid.rows = last.rows;
  SolidReport report;
  report.rule = solid.rule;
  report.rows = last.rows.rows;
  report.interior = static_cast<uint64_t>(solid.interior.likely);
  report.disputed = static_cast<uint64_t>(solid.disputed.likely);
  report.open_rows = last.rows.open;
  report.odd_rows = last.rows.odd;
  if (!options.seed) solid.warning = solid_warning(report, options.scenes.front());
  if (solid.warning)
    solid.warning->message +=
        " (estimated from a build at " + std::to_string(uint64_t{1} << last.levels) + "^3)";
  return solid;
}

// Returns an upper bound of the disk space of a build, without building pilots. The bound is
// several times the actual size.
double max_disk_bytes(const BuildSpec& spec, const PreparedScene& scene, BuildScene& source,
                      const StageContext& context) {
  const GeometryOptions& options = spec.geometry;
  // A triangle touches about A + E + 1 cubes, where A follows from its area and E from its extents
  // (see expected_work()). So it touches about A/4 + E/2 + 1 cubes of twice the edge. The sum over
  // all levels is at most twice the number of its bricks, plus one cube per level.
  double bricks = 0;
  for (const SubvolumePlan& subvolume : scene.plan) bricks += subvolume.weight;
  const double triangles = static_cast<double>(scene.state.counts.triangles);
  const double octree_nodes = 2 * bricks + scene.state.grid.levels * triangles;
  const double subvolumes = expected_subvolumes(scene, spec.run.subvolume_edge);
  const double dags = kMaxDiskBytesPerNode * octree_nodes + max_bytes_around_artifacts(subvolumes);
  double geometry = dags + triangles_on_disk(scene).high;
  if (options.solid == SolidName::kEnclosed) geometry += artifact_copies(options) * dags;
  if (solid_rule_of(options) != SolidRule::kNone) geometry += 2 * planned_rows(scene).all;
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
  const auto size = [](double count) { return size_text(static_cast<uint64_t>(count)); };
  const double free_bytes = static_cast<double>(free);
  const std::string need = std::string(what) + " is estimated to need " + size(bytes.low) + " to " +
                           size(bytes.high) + " of disk at its peak, but " + folder + " has " +
                           size(free_bytes) + " free";
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

// Returns the size of a file without colors: the header's page, the nodes, and the checksums. Each
// level begins at a new page, so up to a page of zeros follows its nodes.
EstimateRange file_size(const EstimateRange& node_bytes, uint32_t grid_levels) {
  constexpr double kPage = global_layout::kPageBytes;
  if (node_bytes.high == 0) return exactly(kPage);
  const double levels = grid_levels + 1 - kBrickLevels;
  const double least = kPage * (levels + 1);
  const EstimateRange used = (1 + 8.0 / global_layout::kChecksumBlockBytes) * node_bytes +
                             exactly(kPage + sizeof(uint64_t));
  return {std::max(used.low, least), std::max(used.likely + levels * kPage / 2, least),
          used.high + levels * kPage};
}

}  // namespace

Estimate estimate_build(const BuildSpec& spec, const PreparedScene& scene, BuildScene& source,
                        const StageContext& context) {
  const GeometryOptions& options = spec.geometry;
  const MemoryBudget& budget = context.budget;
  Estimate estimate;
  estimate.triangles = scene.state.counts.triangles;
  estimate.subvolumes = scene.plan.size();
  for (const SubvolumePlan& subvolume : scene.plan) estimate.expected_bricks += subvolume.weight;
  estimate.free_memory = budget.limit();
  const auto pilots = build_pilots(options, scene, source, context);
  if (pilots.empty()) {
    // Even the coarsest pilot does not fit in memory. The sum of the triangles' expected voxels is
    // an upper bound of the voxels.
    estimate.voxels = {0, scene.state.counts.expected_voxels, scene.state.counts.expected_voxels};
    return estimate;
  }
  const PilotCounts& last = pilots.back();
  const PilotCounts& before = pilots[pilots.size() > 1 ? pilots.size() - 2 : 0];
  const int doublings = static_cast<int>(scene.state.grid.levels - last.levels);
  estimate.pilot_resolution = uint64_t{1} << last.levels;

  const bool is_solid = options.solid != SolidName::kNone;
  const double spread = std::pow(kSpreadPerDoubling, doublings);
  estimate.voxels = grow_count(&PilotCounts::voxels, pilots, is_solid, doublings);
  estimate.svo_nodes = grow_count(&PilotCounts::svo_nodes, pilots, is_solid, doublings);
  const double nodes = std::min(grow_as_dag(pilots, doublings), estimate.svo_nodes.likely);
  estimate.dag_nodes = within(nodes, spread);
  const double pilot_bytes = last.dag_nodes > 0 ? last.file_bytes / last.dag_nodes : 0;
  const double bytes = std::max(
      pilot_bytes,
      std::min(pilot_bytes * std::pow(kBytesGrowthPerDoubling, doublings), kMaxBytesPerNode));
  estimate.file_bytes = file_size(bytes * estimate.dag_nodes, scene.state.grid.levels);

  const double subvolumes = expected_subvolumes(scene, spec.run.subvolume_edge);
  const SubvolumeCosts costs =
      estimate_subvolumes(subvolumes, estimate.svo_nodes.likely, estimate.dag_nodes);
  estimate.disk_bytes = estimate.file_bytes + costs.artifact_bytes + triangles_on_disk(scene);
  // Adds the merge's file and the nodes that are being reordered. Both have about the size of the
  // output file.
  if (options.order != OrderName::kHash)
    estimate.disk_bytes = estimate.disk_bytes + 2.0 * estimate.file_bytes;
  // With cutouts, patches can replace a triangle, so there can be more records than triangles.
  const uint64_t records =
      std::max(scene.state.counts.triangles, scene.triangles->count(kSceneBin));
  const double triangle_bytes =
      static_cast<double>(scene.triangles->record_bytes()) * static_cast<double>(records);
  estimate.memory_bytes =
      memory_of_nodes(estimate.dag_nodes, costs.artifact_nodes.likely, subvolumes) +
      exactly(kTriangleCopies * triangle_bytes) + costs.memory_bytes;
  if (is_solid) {
    const SolidNeeds needs = solid_needs(options, scene, costs, context);
    estimate.disk_bytes = estimate.disk_bytes + needs.disk_bytes;
    estimate.memory_bytes = estimate.memory_bytes + needs.memory_bytes;
    estimate.solid = estimate_solid(options, pilots, doublings);
  }
  for (double* figure :
       {&estimate.memory_bytes.low, &estimate.memory_bytes.likely, &estimate.memory_bytes.high})
    *figure = std::min(*figure, static_cast<double>(budget.limit())) + kBaseMemoryBytes;
  const double growth = last.dag_nodes > 0 ? nodes / last.dag_nodes : 1;
  estimate.cpu_s = within(last.cpu_s * growth * kBuildOverPilotTime, 1.5 * spread);
  if (options.order != OrderName::kHash) estimate.cpu_s = kReorderTime * estimate.cpu_s;
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
  if (max_disk_bytes(spec, scene, source, stage) < static_cast<double>(free_bytes)) return false;
  const Estimate estimate = estimate_build(spec, scene, source, stage);
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
  if (const auto& s = e.solid) {
    json["solid"] = {{"rule", s->rule},
                     {"interior", count_json(s->interior)},
                     {"disputed", count_json(s->disputed)},
                     {"rows", s->rows.rows},
                     {"open_rows", s->rows.open},
                     {"odd_rows", s->rows.odd}};
    json["solid"]["warnings"] = ordered_json::array();
    if (s->warning) json["solid"]["warnings"].push_back(record_json(*s->warning));
  }
  if (const auto& c = e.colors)
    json["colors"] = {{"cells", count_json(c->cells)},
                      {"file_bytes", count_json(c->file_bytes)},
                      {"artifact_bytes", count_json(c->artifact_bytes)},
                      {"spill_bytes", count_json(c->spill_bytes)},
                      {"cpu_s", range_json(c->cpu_s)}};
  return exact_json_text(json, 2);
}

}  // namespace voxdag
