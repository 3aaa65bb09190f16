#include "scheduler/stages/build/split_subvolume.h"

#include "scheduler/solid/part_rows.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/partition/partition.h"
#include "scheduler/state/job_progress.h"

namespace voxdag {

namespace {

bool is_full(const SplitSolid& solid, const Cube& part) {
  const uint32_t levels = solid.rows.grid_levels();
  const MemoryCharge charge(solid.budget, row_bytes(part, levels), "the sample rows of a solid");
  return views_of_empty(solid.rows.read_entry(part), part, levels).is_inside();
}

}  // namespace

std::vector<QueuedSubvolume> split_subvolume(const QueuedSubvolume& whole, uint32_t grid_levels,
                                             TriangleStore& triangles, JobStore& jobs,
                                             Progress& progress, const CancelToken& cancel,
                                             const SplitSolid* solid) {
  const StoredSubvolume& subvolume = whole.subvolume;
  std::vector<Cube> parts(8);
  std::vector<BinId> part_bins(8);
  for (int c = 0; c < 8; ++c) {
    parts[c] = subvolume.cube.child(c);
    part_bins[c] = triangles.add_part(whole.bin);
  }
  if (solid != nullptr)
    add_part_rows(solid->rows, subvolume.cube, parts, *triangles.open(whole.bin), solid->budget,
                  cancel);
  const CubeTree tree(grid_levels, subvolume.cube, parts);
  partition(triangles, whole.bin, tree, part_bins, MemoryPlan::kSplitBufferBytes, cancel);
  std::vector<QueuedSubvolume> queued;
  std::vector<Cube> cubes;
  for (int c = 0; c < 8; ++c) {
    if (triangles.count(part_bins[c]) == 0 && !(solid != nullptr && is_full(*solid, parts[c]))) {
      triangles.release(part_bins[c]);
      continue;
    }
    cubes.push_back(parts[c]);
    queued.push_back({StoredSubvolume{}, part_bins[c]});
    queued.back().subvolume.cube = parts[c];
    queued.back().subvolume.weight = subvolume.weight / 8;
  }
  const std::vector<SubvolumeId> ids = jobs.record_split(subvolume, cubes);
  std::vector<SubvolumeStatus> statuses;
  for (size_t i = 0; i < ids.size(); ++i) {
    queued[i].subvolume.id = ids[i];
    statuses.push_back(status_of(queued[i].subvolume, grid_levels));
  }
  progress.subvolume_split(subvolume.id, statuses);
  triangles.release(whole.bin);
  return queued;
}

}  // namespace voxdag
