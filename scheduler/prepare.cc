#include "scheduler/prepare.h"

#include <algorithm>
#include <thread>

#include "core/base/error.h"
#include "scheduler/memory_limits.h"
#include "scheduler/open_backend.h"

namespace voxdag {
namespace {

// Subvolumes are cut so that each is expected to touch at most this many bricks: a fraction of a
// second of work, and tables that stay in the caches.
constexpr double kMostBricksASubvolume = 4e6;
// ... but small builds are cut into at least about this many pieces, of at least this weight.
constexpr double kLeastPieces = 64;
constexpr double kLeastBricksASubvolume = 131072;
// More bins than this would make their buffers too small; finer cuts are made by splitting.
constexpr size_t kMostBins = 8192;

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidInput, what); }

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

BuildSpec checked(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  levels_of_resolution(g.resolution);
  if (g.scenes.empty()) refuse("no scene was given: expected at least one .glb or .gltf file");
  if (g.hash_bits < 4 || g.hash_bits > 64)
    refuse("hash bits " + std::to_string(g.hash_bits) + ": expected 4 to 64");
  if (g.bounds && g.voxel_size) refuse("bounds and a voxel size were both given: expected one");
  if (r.memory_bytes && r.memory_bytes < kLeastMemory)
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

PreparedScene prepare_scene(const BuildSpec& spec, const std::string& spill_path,
                            MemoryBudget& budget, StageClock& clock, const Seams& seams) {
  PreparedScene prepared;
  const auto scene = open_scene(seams.files, spec.geometry.scenes, {spec.geometry.skip_invalid},
                                budget, seams.cancel);
  for (const std::string& warning : scene->warnings()) seams.progress.warn(warning);
  prepared.grid = choose_grid(spec.geometry, *scene, seams);
  clock.finish("scan");

  const uint32_t levels = prepared.grid.levels;
  const bool wide = spec.geometry.bounds.has_value();  // triangles may reach far outside
  prepared.bins_share = std::make_unique<MemoryBudget>(budget.limit() / 3, &budget);
  prepared.bins =
      std::make_unique<TriangleBins>(seams.files, spill_path, wide, *prepared.bins_share);
  prepared.whole = prepared.bins->add_bin();
  TopTree top(levels, TopTree::depth_within(levels, budget.limit() / 16), budget);
  prepared.counts = ingest(*scene, prepared.grid, *prepared.bins, prepared.whole, top, seams);
  prepared.dropped_invalid = scene->invalid_triangles();
  prepared.plan = choose_subvolumes(top, spec.run);
  clock.finish("ingest");
  return prepared;
}

}  // namespace voxdag
