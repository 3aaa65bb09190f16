// A Backend that runs the parallel pipeline on any space (space.h):
//
//     triangles -> bricks (tiles.h, or the reference voxel_list.h) -> octree -> DAG (by hashes or
//     by pointers) -> level arrays on the host -> sink
//
// The backend owns a `Device` for all its builds. device.open(task, budget, cancel) returns the
// space of one build.
#pragma once

#include <optional>
#include <utility>

#include "core/backend/backend.h"
#include "core/backend/parallel/dag/dag_by_hashes.h"
#include "core/backend/parallel/dag/dag_by_pointers.h"
#include "core/backend/parallel/dag/host_levels.h"
#include "core/backend/parallel/dag/octree.h"
#include "core/backend/parallel/space/brick_list.h"
#include "core/backend/parallel/voxelize/tiles.h"
#include "core/backend/parallel/voxelize/voxel_list.h"

namespace voxdag::parallel {

template <class Space>
BrickList<Space> voxelize(Space& space, Method method, const SubvolumeTask& task,
                          TriangleStream& triangles) {
  const int cube_levels = static_cast<int>(task.grid_levels - task.cube.level);
  const int code_bits = 3 * (cube_levels - kBrickLevels);
  if (method == Method::kFast && cube_levels >= kTileLevels) {
    try {
      BrickList<Space> bricks(space, code_bits);
      voxelize_by_tiles(space, task, triangles, bricks);
      return bricks;
    } catch (const OutOfBudget&) {
      // If the cube is larger than the smallest cube, the caller splits it. The smallest cube must
      // fit for any number of triangles, so voxelize_by_list() voxelizes it below.
      if (cube_levels > kTileLevels) throw;
    }
  }
  BrickList<Space> bricks(space, code_bits);
  voxelize_by_list(space, task, triangles, bricks);
  bricks.merge();
  return bricks;
}

template <class Space>
SpaceDag<Space> make_dag(Space& space, Method method, const Octree<Space>& tree,
                         uint32_t hash_bits) {
  if (method != Method::kPointers)
    if (auto dag = make_dag_by_hashes(space, tree, hash_bits)) return std::move(*dag);
  return make_dag_by_pointers(space, tree, hash_bits);
}

template <class Device>
class ParallelBackend : public Backend {
 public:
  ParallelBackend(Device device, Method method) : device_(std::move(device)), method_(method) {}
  std::string_view name() const override { return Device::kName; }

  BuildOutcome build(const SubvolumeTask& task, TriangleStream& triangles, MemoryBudget& budget,
                     const CancelToken& cancel, SubDagSink& sink, SubDagSummary& summary) override {
    summary = {};
    try {
      auto space = device_.open(task, budget, cancel);
      auto bricks = voxelize(space, method_, task, triangles);
      if (bricks.size() == 0) return BuildOutcome::kBuilt;
      SubDagSummary found;
      const auto levels = reduce(space, task, bricks, found);
      levels.send(task.grid_levels - kBrickLevels, sink);
      summary = found;
      return BuildOutcome::kBuilt;
    } catch (const OutOfBudget&) {
      return BuildOutcome::kNeedsSplit;
    }
  }

 private:
  template <class Space>
  HostLevels<Space> reduce(Space& space, const SubvolumeTask& task, BrickList<Space>& bricks,
                           SubDagSummary& summary) {
    const uint32_t level_count = task.grid_levels - kBrickLevels - task.cube.level;
    auto tree = make_octree(space, bricks, level_count);
    const uint64_t voxels = space.count_bits(tree.brick_masks.data(), tree.brick_count);
    auto dag = make_dag(space, method_, tree, task.hash_bits);
    summary = {voxels, tree.node_count(), dag.node_count(), dag.root_hash};
    tree = {};
    return HostLevels<Space>(space, std::move(dag));
  }

  Device device_;
  const Method method_;
};

}  // namespace voxdag::parallel
