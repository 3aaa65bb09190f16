#include "scheduler/triangles/partition.h"

#include <map>

#include "core/base/process_limits.h"
#include "scheduler/triangles/distribute.h"

namespace voxdag {
namespace {

std::vector<Cube> cubes_of(std::span<const StoredSubvolume> subvolumes) {
  std::vector<Cube> cubes;
  for (const StoredSubvolume& subvolume : subvolumes) cubes.push_back(subvolume.cube);
  return cubes;
}

// New bins that are not kept, one for each of the subvolumes.
std::vector<QueuedSubvolume> queue_up(std::span<const StoredSubvolume> subvolumes,
                                      TriangleBins& bins, std::optional<BinId> kept) {
  std::vector<QueuedSubvolume> queue;
  for (const StoredSubvolume& subvolume : subvolumes)
    queue.push_back({subvolume, bins.add_bin(), kept});
  return queue;
}

std::vector<BinId> bins_of(std::span<const QueuedSubvolume> queue) {
  std::vector<BinId> bins;
  for (const QueuedSubvolume& queued : queue) bins.push_back(queued.bin);
  return bins;
}

// From the whole bin into one kept bin for each cube, with a checkpoint now and then.
void fill_kept_bins(std::span<const StoredSubvolume> planned, PreparedScene& scene,
                    IngestCheckpoint& keeper, size_t buffer_bytes, const CancelToken& cancel) {
  IngestState& state = scene.state;
  TriangleBins& bins = *scene.bins;
  if (scene.kept_bins.empty()) {
    const std::vector<Cube> cubes = cubes_of(planned);
    state.cubes = bins.kept_file()->append(std::as_bytes(std::span(cubes)));
    for (const Cube& cube : cubes) scene.kept_bins.push_back({cube, bins.add_kept_bin()});
  }
  std::vector<Cube> cubes;
  std::vector<BinId> targets;
  for (const KeptBin& kept : scene.kept_bins) {
    cubes.push_back(kept.cube);
    targets.push_back(kept.bin);
  }
  const uint64_t first = state.position;
  BinWriter writer(bins, targets, buffer_bytes);
  distribute(*bins.open(scene.whole, first), CubeTree(scene.grid.levels, Cube{}, cubes), writer,
             cancel, [&](uint64_t copied) {
               state.position = first + copied;
               if (!keeper.is_due()) return;
               writer.flush();
               keeper.save_soon(state, bins);
             });
  state.stage = IngestStage::kReady;
  state.top_tree = {};
  keeper.save(state, bins);
  bins.release(scene.whole);
}

// The kept bin of the cube or of the nearest one around it.
const KeptBin& nearest(const std::map<Cube, const KeptBin*>& kept_bins,
                       const StoredSubvolume& subvolume) {
  for (Cube cube = subvolume.cube;; cube = cube.parent()) {
    const auto found = kept_bins.find(cube);
    if (found != kept_bins.end()) return *found->second;
    if (cube.level == 0)
      throw DamagedTriangles("subvolume " + std::to_string(subvolume.id) +
                             " has no triangles among those that are kept");
  }
}

std::vector<QueuedSubvolume> take_from_kept_bins(std::span<const StoredSubvolume> planned,
                                                 PreparedScene& scene, size_t buffer_bytes,
                                                 const CancelToken& cancel) {
  TriangleBins& bins = *scene.bins;
  std::map<Cube, const KeptBin*> by_cube;
  for (const KeptBin& kept : scene.kept_bins) by_cube[kept.cube] = &kept;
  std::vector<QueuedSubvolume> queue;
  std::map<const KeptBin*, std::vector<StoredSubvolume>> parts;
  for (const StoredSubvolume& subvolume : planned) {
    const KeptBin& kept = nearest(by_cube, subvolume);
    bins.hold(kept.bin, 1);
    if (kept.cube == subvolume.cube)
      queue.push_back({subvolume, kept.bin, kept.bin});
    else
      parts[&kept].push_back(subvolume);
  }
  for (const auto& [kept, subvolumes] : parts) {
    const auto split = queue_up(subvolumes, bins, kept->bin);
    distribute(bins, kept->bin, CubeTree(scene.grid.levels, kept->cube, cubes_of(subvolumes)),
               bins_of(split), buffer_bytes, cancel);
    queue.insert(queue.end(), split.begin(), split.end());
  }
  // Those of subvolumes that are built may be there still.
  for (const KeptBin& kept : scene.kept_bins) {
    bins.hold(kept.bin, 1);
    bins.release(kept.bin);
  }
  return queue;
}

}  // namespace

std::vector<QueuedSubvolume> partition_triangles(std::span<const StoredSubvolume> planned,
                                                 PreparedScene& scene, IngestCheckpoint& keeper,
                                                 size_t buffer_bytes, const CancelToken& cancel) {
  std::vector<QueuedSubvolume> queue;
  if (!scene.bins->kept_file() && scene.state.stage == IngestStage::kReady)
    throw DamagedTriangles("the triangles of what is not built were thought to be built");
  if (scene.bins->kept_file()) {
    if (scene.state.stage == IngestStage::kHandDown)
      fill_kept_bins(planned, scene, keeper, buffer_bytes, cancel);
    queue = take_from_kept_bins(planned, scene, buffer_bytes, cancel);
  } else {
    queue = queue_up(planned, *scene.bins, std::nullopt);
    distribute(*scene.bins, scene.whole, CubeTree(scene.grid.levels, Cube{}, cubes_of(planned)),
               bins_of(queue), buffer_bytes, cancel);
  }
  // Chunks of triangles are small blocks of the heap, which would keep them resident.
  trim_heap();
  return queue;
}

}  // namespace voxdag
