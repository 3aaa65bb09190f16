#include "scheduler/scene_stages.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <span>
#include <thread>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/io/overwrite.h"
#include "scheduler/execute/choose_backend.h"
#include "scheduler/ingest/ingest.h"
#include "scheduler/memory_plan.h"
#include "scheduler/triangles/partition.h"

namespace voxdag {
namespace {

// Expected bricks of a subvolume: a fraction of a second of work, and tables that stay in the
// processor's caches.
constexpr double kMaxBricksPerSubvolume = 4e6;
// A small build has about this many subvolumes at least, of at least this many expected bricks.
constexpr double kMinSubvolumes = 64;
constexpr double kMinBricksPerSubvolume = 131072;
// How long a build waits until the times of the scene's files can be trusted.
constexpr int64_t kMaxWait_ns = 200'000'000;
// Of the color grid, unless another one is asked for: colors do not repeat as geometry does.
constexpr uint64_t kColorResolution = 4096;
// More bins than this would make their buffers too small; large subvolumes are split later.
constexpr size_t kMaxBins = 8192;

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidInput, what); }

std::vector<SubvolumePlan> choose_subvolumes(const TopTree& top, const RunOptions& options) {
  if (options.subvolume_edge) {
    int64_t edge = static_cast<int64_t>(options.subvolume_edge);
    auto plan = top.subvolumes_by_edge(edge);
    while (plan.size() > kMaxBins) plan = top.subvolumes_by_edge(edge *= 2);
    return plan;
  }
  double max_weight = std::clamp(top.total_weight() / kMinSubvolumes, kMinBricksPerSubvolume,
                                 kMaxBricksPerSubvolume);
  auto plan = top.subvolumes_by_weight(max_weight);
  while (plan.size() > kMaxBins) plan = top.subvolumes_by_weight(max_weight *= 2);
  return plan;
}

}  // namespace

BuildSpec checked(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  levels_of_resolution(g.resolution);
  if (g.scenes.empty())
    refuse("no scene was given: expected at least one .glb, .gltf or .ply file");
  if (g.hash_bits < 4 || g.hash_bits > 64)
    refuse("hash bits " + std::to_string(g.hash_bits) + ": expected 4 to 64");
  if (g.bounds && g.voxel_size) refuse("bounds and a voxel size were both given: expected one");
  if (r.memory_bytes && r.memory_bytes < kMinMemory)
    refuse("memory " + std::to_string(r.memory_bytes) + " bytes: expected at least 64 MiB");
  const uint64_t edge = r.subvolume_edge;
  if (edge && ((edge & (edge - 1)) || edge < static_cast<uint64_t>(kSmallestEdge)))
    refuse("subvolume edge " + std::to_string(edge) + ": expected a power of two from 64 voxels");
  if (g.color_resolution && !g.attributes.any())
    refuse("a color resolution was given without colors: expected both (--color, or --attributes)");
  if (g.color_resolution && (!std::has_single_bit(g.color_resolution) || g.color_resolution < 4 ||
                             g.color_resolution > g.resolution))
    refuse("color resolution " + std::to_string(g.color_resolution) +
           ": expected a power of two from 4 to the resolution, " + std::to_string(g.resolution));
  choose_grid(g, WorldBounds{});  // throws for a cube or a voxel size that makes no grid
  check_backend(r);
  BuildSpec out = spec;
  if (!r.threads) out.run.threads = default_threads();
  if (!r.memory_bytes) out.run.memory_bytes = default_memory();
  if (g.attributes.any() && !g.color_resolution)
    out.geometry.color_resolution = std::min(g.resolution, kColorResolution);
  return out;
}

void refuse_own_files(const BuildSpec& spec, const std::string& work_folder,
                      std::span<const std::string> outputs, const BuildContext& context) {
  FileSystem& files = context.files;
  std::vector<std::string> own = WorkFolder::files_in(files, work_folder);
  const bool is_first = !own.empty() && !files.exists(WorkFolder::store_path(work_folder));
  own.insert(own.end(), outputs.begin(), outputs.end());
  refuse_inputs(files, own, spec.geometry.scenes);
  // Anything may begin with zeros, as an unfinished output does.
  const bool is_unknown = std::ranges::any_of(outputs, [&](const std::string& path) {
    const auto file = open_if_there(files, path);
    return file && begins_with(*file, std::string_view("\0", 1));
  });
  if (!is_first && !is_unknown) return;
  MemoryBudget budget(spec.run.memory_bytes);
  const auto scene =
      open_scene(files, spec.geometry.scenes, {.skip_invalid = spec.geometry.skip_invalid}, budget,
                 context.cancel);
  std::vector<std::string> inputs;
  for (const SourceFile& file : scene->files()) inputs.push_back(file.path);
  refuse_inputs(files, own, inputs);
}

namespace {

class Preparation {
 public:
  Preparation(const BuildSpec& spec, MemoryBudget& budget, const BuildContext& context,
              IngestCheckpoint& checkpoint)
      : spec_(spec), budget_(budget), context_(context), checkpoint_(checkpoint) {}

  PreparedScene run(StageClock& clock) {
    state_ = checkpoint_.resume().value_or(IngestState{});
    if (state_.stage < IngestStage::kPartition) open();
    if (state_.stage == IngestStage::kScan) find_grid();
    clock.finish("scan");
    open_store();
    if (state_.stage < IngestStage::kReady) ingest_and_plan();
    prepared_.max_durable_bytes = max_durable_bytes(spec_, state_.declared_triangles);
    clock.finish("ingest");
    return std::move(prepared_);
  }

 private:
  void reopen() {
    scene_ = open_scene(context_.files, spec_.geometry.scenes,
                        {spec_.geometry.skip_invalid, checkpoint_.decoded_path()}, budget_,
                        context_.cancel);
  }

  void open() {
    const int64_t opened_ns = unix_ns();
    reopen();
    if (!checkpoint_.matches(scene_->files())) {
      state_ = {};
      enable_checkpoints(opened_ns);
    }
    state_.declared_triangles = scene_->declared_triangles();
    if (state_.position == 0) checkpoint_.check_disk_space(*scene_);
    for (const std::string& warning : scene_->warnings()) context_.progress.warn(warning);
  }

  // Waits until the scene's files are old enough to trust their times, if that is soon.
  void enable_checkpoints(int64_t opened_ns) {
    checkpoint_.forget();
    if (!checkpoint_.is_worthwhile(*scene_)) return;
    const int64_t wait_ns = trusted_from_ns(scene_->files()) - opened_ns;
    if (wait_ns > 0 && wait_ns <= kMaxWait_ns) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
      opened_ns = unix_ns();
      reopen();
    }
    checkpoint_.enable(*scene_, opened_ns);
  }

  void find_grid() {
    if (!spec_.geometry.bounds)
      scan(*scene_, state_, stage_context(), [&] {
        if (checkpoint_.is_due()) checkpoint_.save(state_);
      });
    state_.grid = choose_grid(spec_.geometry, state_.bounds);
    state_.stage = IngestStage::kIngest;
    state_.position = 0;
    state_.digest = ContentDigest(state_.grid);
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
    checkpoint_.load_top_tree(state_, top);
    if (state_.stage == IngestStage::kIngest) {
      ingest(*scene_, state_, *prepared_.triangles, top, stage_context(), [&] {
        if (checkpoint_.is_due()) checkpoint_.save_in_background(state_, &top);
      });
      state_.stage = IngestStage::kPartition;
      state_.position = 0;
      checkpoint_.save(state_, &top);
    }
    prepared_.plan = choose_subvolumes(top, spec_.run);
  }

  StageContext stage_context() const { return {context_, spec_.run.threads, budget_}; }

  const BuildSpec& spec_;
  MemoryBudget& budget_;
  const MemoryPlan memory_ = MemoryPlan::divide(budget_.limit());
  const BuildContext& context_;
  IngestCheckpoint& checkpoint_;
  std::unique_ptr<TriangleSource> scene_;
  PreparedScene prepared_;
  IngestState& state_ = prepared_.state;
};

}  // namespace

PreparedScene prepare_scene(const BuildSpec& spec, MemoryBudget& budget, StageClock& clock,
                            const BuildContext& context, IngestCheckpoint& checkpoint) {
  return Preparation(spec, budget, context, checkpoint).run(clock);
}

std::vector<BinId> partition_prepared(PreparedScene& scene, std::span<const Cube> cubes,
                                      IngestCheckpoint& checkpoint, const StageContext& context) {
  const size_t buffer_bytes = MemoryPlan::divide(context.budget.limit()).partition_buffer_bytes;
  IngestState& state = scene.state;
  TriangleStore& triangles = *scene.triangles;
  if (state.stage < IngestStage::kReady) {
    partition_scene(triangles, state.grid.levels, cubes, buffer_bytes, state.position, context,
                    [&](uint64_t copied, BinWriter& writer) {
                      state.position = copied;
                      if (!checkpoint.is_due()) return;
                      writer.flush();
                      checkpoint.save_in_background(state);
                    });
    state.stage = IngestStage::kReady;
    state.top_tree = {};
    checkpoint.save(state);
    triangles.release(kSceneBin);
  }
  const auto bins = assign_bins(triangles, state.grid.levels, cubes, buffer_bytes, context);
  // Chunks of triangles are small blocks of the heap, which would keep them resident.
  trim_heap();
  return bins;
}

}  // namespace voxdag
