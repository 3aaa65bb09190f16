#include "scheduler/stages/ingest/ingest_stage.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "core/backend/backend.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "scene/formats/formats.h"
#include "scene/textures/find_cutouts.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/spec/build_fields.h"
#include "scheduler/spec/gpu_use.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/ingest/ingest.h"

namespace voxdag {
namespace {

// Maximum expected bricks per subvolume. Building that many takes a fraction of a second, and their
// tables fit in the processor's caches.
constexpr double kMaxBricksPerSubvolume = 4e6;
// Maximum expected bricks per flat subvolume, which has large triangles (SubvolumeLimits). Building
// it takes only 3 to 16 ns per expected brick, so this maximum is higher than the maximum of
// other subvolumes. With larger subvolumes, fewer equal nodes occur in more than one subvolume, so
// the merge reads fewer rows.
constexpr double kMaxBricksPerFlatSubvolume = 128e6;
// Bytes of memory per expected brick, enough for most flat subvolumes. If a flat subvolume
// needs more memory than a worker has, the worker splits it.
constexpr double kBytesPerFlatBrick = 16;
// Limits for subvolumes that a GPU builds. The GPU needs about 3 ms for each subvolume in addition
// to the time for its bricks. For each worker there are at least kMinSubvolumesPerGpuWorker
// subvolumes, or fewer if a subvolume would have less than kMinBricksPerGpuSubvolume expected
// bricks.
constexpr double kMaxBricksPerGpuSubvolume = 32e6;
constexpr double kMinBricksPerGpuSubvolume = 1e6;
constexpr double kMinSubvolumesPerGpuWorker = 4;
// Bytes of device memory per expected brick, enough for most subvolumes.
constexpr double kBytesPerGpuBrick = 128;
// A small build has about kMinSubvolumes subvolumes, or fewer if each would have less than
// kMinBricksPerSubvolume expected bricks.
constexpr double kMinSubvolumes = 64;
constexpr double kMinBricksPerSubvolume = 131072;
// Minimum number of flat subvolumes per thread, so that the threads finish at about the same time.
constexpr double kMinSubvolumesPerThread = 16;
// Maximum wait of enable_checkpoints() for trusted_from_ns().
constexpr int64_t kMaxWaitNs = 200'000'000;
// Maximum number of bins. With more bins, each bin's buffer would be too small. Large subvolumes
// are split later instead.
constexpr size_t kMaxBins = 8192;

// Returns the longest edge of a subvolume. A worker holds all sample rows of a solid's subvolume,
// so the memory for them limits the edge.
int64_t longest_edge(const BuildSpec& spec) {
  if (solid_rule_of(spec.geometry) == SolidRule::kNone) return INT64_MAX;
  int64_t edge = kSmallestEdge;
  while (edge < kMaxOptionEdge &&
         solid_row_bytes(2 * edge) <= MemoryPlan::solid_row_bytes(spec.run.memory_bytes))
    edge *= 2;
  return edge;
}

// Returns the number of GPUs that probably build the subvolumes in this process.
int planned_gpus(const BuildSpec& spec, double total_weight) {
  // Only the CPU backend fills solids.
  if (spec.run.cluster || solid_rule_of(spec.geometry) != SolidRule::kNone) return 0;
  return gpus_to_use(spec.run, spec.geometry.rule(), total_weight);
}

// Returns the maximum weight of a flat subvolume in a build without GPUs. With this maximum, there
// are enough subvolumes for all threads, and the tables of a subvolume fit in half of a worker's
// share. Returns 0 if flat subvolumes have no separate maximum.
double max_flat_weight(const BuildSpec& spec, double total_weight) {
  const RunOptions& run = spec.run;
  // The tasks of a cluster can have less memory, and `parallel-host` needs more.
  if (run.cluster || run.backend == BackendName::kParallelHost) return 0;
  const double subvolumes = std::max(kMinSubvolumes, kMinSubvolumesPerThread * run.threads);
  const WorkerMemory memory = WorkerMemory::divide(run.memory_bytes / 2, run.threads);
  return std::min({kMaxBricksPerFlatSubvolume, total_weight / subvolumes,
                   static_cast<double>(memory.share_bytes / 2) / kBytesPerFlatBrick});
}

// Returns the subvolumes within the limits. If there are more than kMaxBins, doubles the limits.
std::vector<SubvolumePlan> subvolumes_within(const TopTree& top, SubvolumeLimits limits) {
  auto plan = top.subvolumes_by_weight(limits);
  while (plan.size() > kMaxBins) {
    if (limits.edge <= kMaxOptionEdge) limits.edge *= 2;
    limits.weight *= 2;
    plan = top.subvolumes_by_weight(limits);
  }
  return plan;
}

SubvolumeLimits limits_for_gpus(const BuildSpec& spec, double total_weight, int gpus) {
  const unsigned workers = std::min(spec.run.threads, kWorkersPerGpu * static_cast<unsigned>(gpus));
  const WorkerMemory memory = WorkerMemory::divide(spec.run.memory_bytes / 2, workers);
  const double fitting = static_cast<double>(memory.share_bytes) / kBytesPerGpuBrick;
  const double balanced = total_weight / (kMinSubvolumesPerGpuWorker * workers);
  return {.weight = std::max(
              kMinBricksPerSubvolume,
              std::min(std::clamp(balanced, kMinBricksPerGpuSubvolume, kMaxBricksPerGpuSubvolume),
                       fitting))};
}

std::vector<SubvolumePlan> choose_subvolumes(const TopTree& top, const BuildSpec& spec) {
  const RunOptions& options = spec.run;
  int64_t longest = longest_edge(spec);
  if (options.subvolume_edge) {
    int64_t edge = std::min(static_cast<int64_t>(options.subvolume_edge), longest);
    auto plan = top.subvolumes_by_edge(edge);
    while (plan.size() > kMaxBins) plan = top.subvolumes_by_edge(edge *= 2);
    return plan;
  }
  if (const int gpus = planned_gpus(spec, top.total_weight()))
    return subvolumes_within(top, limits_for_gpus(spec, top.total_weight(), gpus));
  const SubvolumeLimits limits{.weight = std::clamp(top.total_weight() / kMinSubvolumes,
                                                    kMinBricksPerSubvolume, kMaxBricksPerSubvolume),
                               .flat_weight = max_flat_weight(spec, top.total_weight()),
                               .edge = longest};
  return subvolumes_within(top, limits);
}

TopTreeCells cells_of(const TopTree& top) { return {top.cells(), top.total_weight()}; }

class Preparation {
 public:
  Preparation(const BuildSpec& spec, BuildScene& scene, MemoryBudget& budget,
              const BuildContext& context, IngestCheckpoint& checkpoint)
      : spec_(spec), scene_(scene), budget_(budget), context_(context), checkpoint_(checkpoint) {}

  PreparedScene run(StageClock& clock) {
    state_ = checkpoint_.resume().value_or(IngestState{});
    if (state_.stage < IngestStage::kPartition) open();
    if (state_.stage == IngestStage::kScan) find_grid();
    clock.finish("scan");
    open_store();
    if (state_.stage < IngestStage::kReady) ingest_and_plan();
    prepared_.max_disk_bytes =
        max_disk_bytes(spec_, state_.declared_triangles, prepared_.triangles->count(kSceneBin));
    clock.finish("ingest");
    return std::move(prepared_);
  }

 private:
  void open() {
    WarningList warnings;
    if (!checkpoint_.matches(files())) {
      state_ = {};
      enable_checkpoints();
    }
    find_cutouts(warnings);
    const TriangleSource& scene = scene_.open();
    state_.declared_triangles = scene.declared_triangles();
    if (state_.position == 0) checkpoint_.check_disk_space(scene);
    for (const Warning& warning : scene.warnings()) context_.progress.warn_of_input(warning);
    // Reported last, because enable_checkpoints() above removes all recorded warnings.
    for (const Warning& warning : warnings.list()) context_.progress.warn_of_input(warning);
  }

  // Returns the files that determine the voxels: the scene's files, and the images of cutouts that
  // are left out.
  std::vector<SourceFile> files() {
    std::vector<SourceFile> all = scene_.open().files();
    if (spec_.geometry.cutouts != CutoutRule::kSkip) return all;
    for (SourceFile& file : cutout_files(scene_.open().materials()))
      if (std::ranges::find(all, file) == all.end()) all.push_back(std::move(file));
    return all;
  }

  // Finds the cutouts that the build leaves out. Adds a warning if it keeps cutouts.
  void find_cutouts(WarningList& warnings) {
    const CutoutRule rule = spec_.geometry.cutouts;
    if (rule == CutoutRule::kDefault) return;
    const SceneMaterials materials = scene_.open().materials();
    // With attributes, the color stage reports these warnings.
    if (rule == CutoutRule::kSkip && !spec_.geometry.attributes.any())
      warnings = materials.warnings;
    if (!may_have_cutouts(materials)) return;
    if (rule == CutoutRule::kKeep) {
      warn_of_kept_cutouts(count_cutout_materials(materials), warnings);
      return;
    }
    WarningList problems;
    Cutouts found = voxdag::find_cutouts(context_.files, materials, spec_.run.threads, budget_,
                                         context_.cancel, problems);
    // With colors, the color stage reports unreadable images.
    if (!spec_.geometry.attributes.use_images()) warnings.add(problems.list());
    cutouts_.emplace(std::move(found));
  }
  void warn_of_kept_cutouts(uint64_t materials, WarningList& warnings) const {
    if (materials == 0) return;
    warnings.add({"kept-cutouts", spec_.geometry.scenes.front(),
                  std::to_string(materials) +
                      (materials == 1 ? " material has" : " materials have") +
                      " an alpha mode that may cut out parts of surfaces, which are kept; " +
                      option_text("cutouts", "skip") + " leaves them out"});
  }
  const Cutouts* cutouts() const { return cutouts_ ? &*cutouts_ : nullptr; }

  // Enables checkpoints. If the scene's files were changed just before they were opened, it is
  // possible that a further change does not change their times. In this case, first waits until
  // trusted_from_ns(), unless this takes longer than kMaxWaitNs.
  void enable_checkpoints() {
    checkpoint_.forget();
    if (!checkpoint_.is_worthwhile(scene_.open())) return;
    const int64_t wait_ns = trusted_from_ns(files()) - scene_.opened_ns();
    if (wait_ns > 0 && wait_ns <= kMaxWaitNs) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
      scene_.close();
    }
    std::vector<SourceFile> current = files();
    checkpoint_.enable(scene_.open(), std::move(current), scene_.opened_ns());
  }

  void find_grid() {
    if (!spec_.geometry.bounds)
      scan(scene_.open(), state_, stage_context(), [&] {
        if (checkpoint_.is_due()) checkpoint_.save(state_);
      });
    state_.grid = choose_grid(spec_.geometry, state_.bounds);
    state_.stage = IngestStage::kIngest;
    state_.position = 0;
    state_.digest = initial_digest(state_.grid, cutouts());
    state_.top_tree_depth = TopTree::depth_within(state_.grid.levels, memory_.top_tree_bytes);
    checkpoint_.save(state_);
  }

  void open_store() {
    prepared_.triangle_budget = std::make_unique<MemoryBudget>(memory_.triangle_bytes, &budget_);
    prepared_.triangles = checkpoint_.open_store(state_, *prepared_.triangle_budget);
    if (state_.stage == IngestStage::kReady) prepared_.triangles->release(kSceneBin);
  }

  void ingest_and_plan() {
    TopTree top(state_.grid.levels, budget_, state_.top_tree_depth);
    if (checkpoint_.has_top_tree(state_))
      checkpoint_.load_top_tree(state_, top.fill(state_.top_tree_weight));
    if (state_.stage == IngestStage::kIngest) {
      ingest(
          scene_.open(), state_, *prepared_.triangles, top, stage_context(),
          [&] {
            if (checkpoint_.is_due()) checkpoint_.save_in_background(state_, cells_of(top));
          },
          cutouts());
      state_.stage = IngestStage::kPartition;
      state_.position = 0;
      checkpoint_.save(state_, cells_of(top));
    }
    prepared_.plan = choose_subvolumes(top, spec_);
  }

  StageContext stage_context() const { return {context_, spec_.run.threads, budget_}; }

  const BuildSpec& spec_;
  BuildScene& scene_;
  MemoryBudget& budget_;
  const MemoryPlan memory_ = MemoryPlan::divide(budget_.limit());
  const BuildContext& context_;
  IngestCheckpoint& checkpoint_;
  std::optional<Cutouts> cutouts_;  // cutouts that are left out
  PreparedScene prepared_;
  IngestState& state_ = prepared_.state;
};

}  // namespace

PreparedScene prepare_scene(const BuildSpec& spec, BuildScene& scene, MemoryBudget& budget,
                            StageClock& clock, const BuildContext& context,
                            IngestCheckpoint& checkpoint) {
  return Preparation(spec, scene, budget, context, checkpoint).run(clock);
}

}  // namespace voxdag
