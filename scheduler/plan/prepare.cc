#include "scheduler/plan/prepare.h"

#include <algorithm>
#include <chrono>
#include <span>
#include <thread>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "scheduler/execute/open_backend.h"
#include "scheduler/ingest/ingest.h"
#include "scheduler/memory_plan.h"

namespace voxdag {
namespace {

// Subvolumes are cut so that each is expected to touch at most this many bricks: a fraction of a
// second of work, and tables that stay in the caches.
constexpr double kMaxBricksPerSubvolume = 4e6;
// ... but small builds are cut into at least about this many pieces, of at least this weight.
constexpr double kMinPieces = 64;
constexpr double kMinBricksPerSubvolume = 131072;
// For so long a kept scene's files are waited for until their times can be trusted.
constexpr int64_t kLongestWait_ns = 200'000'000;
// More bins than this would make their buffers too small; finer cuts are made by splitting.
constexpr size_t kMaxBins = 8192;

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidInput, what); }

std::vector<SubvolumePlan> choose_subvolumes(const TopTree& top, const RunOptions& options) {
  if (options.subvolume_edge) {
    int64_t edge = static_cast<int64_t>(options.subvolume_edge);
    auto plan = top.subvolumes_by_edge(edge);
    while (plan.size() > kMaxBins) plan = top.subvolumes_by_edge(edge *= 2);
    return plan;
  }
  double most =
      std::clamp(top.total_weight() / kMinPieces, kMinBricksPerSubvolume, kMaxBricksPerSubvolume);
  auto plan = top.subvolumes_by_weight(most);
  while (plan.size() > kMaxBins) plan = top.subvolumes_by_weight(most *= 2);
  return plan;
}

}  // namespace

BuildSpec checked(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  levels_of_resolution(g.resolution);
  if (g.scenes.empty()) refuse("no scene was given: expected at least one .glb or .gltf file");
  if (g.hash_bits < 4 || g.hash_bits > 64)
    refuse("hash bits " + std::to_string(g.hash_bits) + ": expected 4 to 64");
  if (g.bounds && g.voxel_size) refuse("bounds and a voxel size were both given: expected one");
  if (r.memory_bytes && r.memory_bytes < kMinMemory)
    refuse("memory " + std::to_string(r.memory_bytes) + " bytes: expected at least 64 MiB");
  const uint64_t edge = r.subvolume_edge;
  if (edge && ((edge & (edge - 1)) || edge < static_cast<uint64_t>(kSmallestEdge)))
    refuse("subvolume edge " + std::to_string(edge) + ": expected a power of two from 64 voxels");
  check_backend(r);
  BuildSpec out = spec;
  if (!r.threads) out.run.threads = std::max(1u, std::thread::hardware_concurrency());
  if (!r.memory_bytes) out.run.memory_bytes = default_memory();
  return out;
}

namespace {

class Preparation {
 public:
  Preparation(const BuildSpec& spec, MemoryBudget& budget, const BuildContext& context,
              IngestCheckpoint* keeper)
      : spec_(spec), budget_(budget), context_(context), keeper_(keeper) {}

  PreparedScene run(const std::string& spill_path, StageClock& clock) {
    if (keeper_) state_ = keeper_->resume().value_or(IngestState{});
    if (state_.stage < IngestStage::kHandDown) open();
    if (state_.stage == IngestStage::kScan) find_grid();
    prepared_.grid = state_.grid;
    clock.finish("scan");
    open_bins(spill_path);
    if (state_.stage < IngestStage::kReady) take_in();
    prepared_.counts = state_.counts;
    prepared_.max_kept_bytes = max_kept_bytes(spec_, state_.declared_triangles);
    prepared_.sha256 = state_.digest.hex();
    clock.finish("ingest");
    return std::move(prepared_);
  }

 private:
  bool keeps() const { return keeper_ && keeper_->keeps(); }

  void open_again() {
    scene_ = open_scene(context_.files, spec_.geometry.scenes, {spec_.geometry.skip_invalid},
                        budget_, context_.cancel);
  }

  void open() {
    const int64_t opened_ns = unix_ns();
    open_again();
    if (keeper_ && !keeper_->is_of(scene_->files())) {
      state_ = {};
      begin_to_keep(opened_ns);
    }
    state_.declared_triangles = scene_->declared_triangles();
    for (const std::string& warning : scene_->warnings()) context_.progress.warn(warning);
  }

  // Waits until the scene's files are old enough to trust their times, if that is soon.
  void begin_to_keep(int64_t opened_ns) {
    keeper_->forget();
    if (!keeper_->wants(*scene_)) return;
    const int64_t wait_ns = settled_ns(scene_->files()) - opened_ns;
    if (wait_ns > 0 && wait_ns <= kLongestWait_ns) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
      opened_ns = unix_ns();
      open_again();
    }
    keeper_->begin(*scene_, opened_ns);
  }

  void find_grid() {
    if (!spec_.geometry.bounds)
      scan(*scene_, state_, context_, [&] {
        if (keeper_ && keeper_->is_due()) keeper_->save_scan(state_);
      });
    state_.grid = choose_grid(spec_.geometry, state_.bounds);
    state_.stage = IngestStage::kIngest;
    state_.position = 0;
    state_.digest = ContentDigest(state_.grid);
    state_.top_tree_depth = TopTree::depth_within(state_.grid.levels, memory_.top_tree_bytes);
    if (keeps()) keeper_->save_scan(state_);
  }

  void open_bins(const std::string& spill_path) {
    prepared_.bins_share = std::make_unique<MemoryBudget>(memory_.triangle_bytes, &budget_);
    // By given bounds, triangles may reach far outside.
    prepared_.bins = std::make_unique<TriangleBins>(
        context_.files, spill_path, spec_.geometry.bounds.has_value(), *prepared_.bins_share);
    TriangleBins& bins = *prepared_.bins;
    const bool all_built = state_.stage == IngestStage::kReady && state_.file_end == 0;
    if (!keeps() || all_built) {
      prepared_.whole = bins.add_bin();
      return;
    }
    bins.keep_in(keeper_->open_file(state_.file_end));
    prepared_.whole = bins.add_kept_bin();
    bins.hold(prepared_.whole, 1);
    std::vector<Cube> cubes(state_.cubes.bytes / sizeof(Cube));
    if (!cubes.empty())
      bins.kept_file()->read(state_.cubes, std::as_writable_bytes(std::span(cubes)));
    for (const Cube& cube : cubes) prepared_.kept_bins.push_back({cube, bins.add_kept_bin()});
    bins.read_chain(state_.chunks);
    if (state_.stage == IngestStage::kReady) bins.release(prepared_.whole);
  }

  // Ingest, as far as it is not done, and the plan.
  void take_in() {
    TopTree top(state_.grid.levels, state_.top_tree_depth, budget_);
    if (state_.top_tree.bytes)
      prepared_.bins->kept_file()->read(state_.top_tree, top.fill(state_.top_tree_weight));
    if (state_.stage == IngestStage::kIngest) {
      BinWriter writer(*prepared_.bins, {prepared_.whole}, MemoryPlan::kIngestBufferBytes);
      ingest(*scene_, spec_.run.threads, state_, writer, top, context_, [&] {
        if (!keeper_ || !keeper_->is_due()) return;
        writer.flush();
        append(top);
        keeper_->save_soon(state_, *prepared_.bins);
      });
      state_.stage = IngestStage::kHandDown;
      state_.position = 0;
      if (prepared_.bins->kept_file()) {
        append(top);
        keeper_->save(state_, *prepared_.bins);
      }
    }
    prepared_.plan = choose_subvolumes(top, spec_.run);
  }

  void append(const TopTree& top) {
    state_.top_tree = prepared_.bins->kept_file()->append(top.cells());
    state_.top_tree_weight = top.total_weight();
  }

  const BuildSpec& spec_;
  MemoryBudget& budget_;
  const MemoryPlan memory_ = MemoryPlan::divide(budget_.limit());
  const BuildContext& context_;
  IngestCheckpoint* const keeper_;
  std::unique_ptr<TriangleSource> scene_;
  PreparedScene prepared_;
  IngestState& state_ = prepared_.state;
};

}  // namespace

PreparedScene prepare_scene(const BuildSpec& spec, const std::string& spill_path,
                            MemoryBudget& budget, StageClock& clock, const BuildContext& context,
                            IngestCheckpoint* keeper) {
  return Preparation(spec, budget, context, keeper).run(spill_path, clock);
}

}  // namespace voxdag
