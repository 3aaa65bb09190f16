#include "scheduler/stages/enclose/cube_walks.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <optional>
#include <utility>

#include "core/backend/backend.h"
#include "core/base/parallel_for.h"
#include "core/dag/space/cube_walk.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/enclose/artifact_tree.h"
#include "scheduler/stages/enclose/enclose_worker.h"
#include "scheduler/stages/enclose/read_levels.h"

namespace voxdag {
namespace {

constexpr int kCubes = 8;                 // a cube and its seven neighbors
constexpr Cube kVoxelGrid{1, {1, 1, 1}};  // the voxels' grid, as a cube of the positions' grid

// Converts a cube of the positions' grid to the same cube of the voxels' grid. Returns nullopt if
// the cube is outside the voxels' grid.
std::optional<Cube> voxel_cube(const Cube& positions) {
  if (positions.level == 0) return std::nullopt;
  Cube out{positions.level - 1, {}};
  const uint32_t first = uint32_t{1} << out.level;
  for (int a = 0; a < 3; ++a) {
    if (positions.position[a] < first) return std::nullopt;
    out.position[a] = positions.position[a] - first;
  }
  return out;
}

// Computes the blocked positions (kBlocked) or the enclosed voxels (kEnclosed) of all cubes of the
// grid. The result of a cube is computed from the artifacts of the cube and its neighbors. Cubes
// are cubes of the positions' grid.
class WalkPass {
 public:
  enum class Kind { kBlocked, kEnclosed };

  WalkPass(BuildJob& job, Kind kind, const std::vector<FilledPart>& parts, FilledParts& result)
      : job_(job),
        kind_(kind),
        radius_(job.spec.geometry.radius),
        tree_(job.work, parts, job.budget),
        result_(result),
        levels_(position_shape(job.shape()).grid_levels),
        shape_(kind == Kind::kBlocked ? position_shape(job.shape()) : job.shape()) {}

  // Returns the parts of the result.
  std::vector<FilledPart> run() {
    find_cubes(kind_ == Kind::kBlocked ? Cube{} : kVoxelGrid);
    job_.context.progress.begin_stage("enclose", cubes_.size(), "subvolumes");
    // Leaves 1/8 of the memory for the indexes of artifacts.
    workers_ = make_enclose_workers(
        job_, WorkerMemory::divide(job_.budget.available() / 8 * 7, job_.spec.run.threads));
    parallel_for(static_cast<unsigned>(workers_.size()), cubes_.size(),
                 [&](unsigned worker, size_t i) {
                   filter(*workers_[worker], cubes_[i]);
                   job_.context.progress.advance(1);
                 });
    for (const auto& worker : workers_)
      parts_.insert(parts_.end(), worker->done.begin(), worker->done.end());
    return std::move(parts_);
  }
  void finish(std::vector<FilledPart> parts) {
    complete_pass(result_, std::move(parts), workers_);
    job_.context.progress.end_stage();
  }

 private:
  using Places = std::array<ArtifactTree::Place, kCubes>;

  // Returns a neighbor of the cube, or the cube itself if `neighbor` is 0. The result is a cube of
  // the grid to which the artifacts in tree_ belong. This is the voxels' grid for kBlocked, and the
  // positions' grid for kEnclosed. Returns nullopt if the neighbor is outside this grid.
  std::optional<Cube> source_cube(const Cube& cube, int neighbor) const {
    Cube out = cube;
    for (int a = 0; a < 3; ++a) {
      if ((neighbor >> (2 - a) & 1) == 0) continue;
      if (kind_ == Kind::kBlocked && out.position[a] + 1 == uint32_t{1} << cube.level)
        return std::nullopt;
      out.position[a] += kind_ == Kind::kBlocked ? 1u : ~0u;
    }
    return kind_ == Kind::kBlocked ? voxel_cube(out) : std::optional(out);
  }
  Places places(const Cube& cube) const {
    Places out;
    for (int n = 0; n < kCubes; ++n)
      if (const auto source = source_cube(cube, n))
        out[static_cast<size_t>(n)] = tree_.find(*source);
    // For the complete grid of the positions, source_cube() returns nullopt, because it is larger
    // than the voxels' grid. But it contains the voxels' grid, so find_cubes() must divide it.
    if (kind_ == Kind::kBlocked && cube.level == 0) out[0].kind = ArtifactTree::Kind::kDivided;
    return out;
  }
  bool is_empty(const Places& places) const {
    if (kind_ == Kind::kEnclosed) return places[0].kind == ArtifactTree::Kind::kEmpty;
    return std::ranges::all_of(
        places, [](const auto& place) { return place.kind == ArtifactTree::Kind::kEmpty; });
  }

  // Divides `cube` until neither a cube nor one of its neighbors is kDivided (artifact_tree.h).
  // Adds the resulting cubes to cubes_, except cubes with an empty result.
  void find_cubes(const Cube& cube) {
    const Places around = places(cube);
    if (is_empty(around)) return;
    if (std::ranges::none_of(
            around, [](const auto& place) { return place.kind == ArtifactTree::Kind::kDivided; }))
      return cubes_.push_back(cube);
    for (int octant = 0; octant < 8; ++octant) find_cubes(cube.child(octant));
  }

  // Computes the blocked positions or the enclosed voxels of a cube (see kind_), unless result_ has
  // them from an earlier run. If the cube does not fit in the worker's memory, its octants are
  // computed one after the other.
  void filter(EncloseWorker& worker, const Cube& cube) {
    job_.context.cancel.check();
    const Cube out = kind_ == Kind::kBlocked ? cube : *voxel_cube(cube);
    if (const auto filled = result_.find(out)) return keep(*filled);
    const Places around = places(cube);
    if (is_empty(around)) return;
    try {
      try_filter(worker, cube, out, around);
    } catch (const OutOfBudget&) {
      if (cube.edge_voxels(levels_) <= kSmallestEdge) worker.refuse_memory();
      for (int octant = 0; octant < 8; ++octant) filter(worker, cube.child(octant));
      return;
    }
    if (!worker.is_due(job_)) return;
    for (const FilledPart& part : worker.done) keep(part);
    worker.save(result_);
  }
  void keep(const FilledPart& part) {
    const std::lock_guard lock(mutex_);
    parts_.push_back(part);
  }

  void try_filter(EncloseWorker& worker, const Cube& cube, const Cube& out, const Places& around) {
    PooledMemory memory{worker.share, worker.pool};
    const int size_log2 = static_cast<int>(levels_ - cube.level);
    SubDagTables tables(memory, size_log2);
    std::array<std::optional<NodeLevels>, kCubes> levels;
    CubeNeighbors sources;
    for (int n = 0; n < kCubes; ++n) {
      auto& read = levels[static_cast<size_t>(n)];
      read = read_source(worker, around[static_cast<size_t>(n)], cube, n, memory);
      if (read) sources[static_cast<size_t>(n)].levels = &*read;
    }
    const NodeRef root = kind_ == Kind::kBlocked
                             ? add_blocked(memory, sources, size_log2, radius_, tables)
                             : add_enclosed(memory, sources, size_log2, radius_, tables);
    levels = {};
    if (root.exists) worker.add(out, shape_, tables);
  }

  // Reads the voxels of a neighbor of the cube, or of the cube itself if `neighbor` is 0. Reads
  // only the voxels of the neighbor that are near the cube.
  std::optional<NodeLevels> read_source(EncloseWorker& worker, const ArtifactTree::Place& place,
                                        const Cube& cube, int neighbor,
                                        PooledMemory& memory) const {
    if (place.kind == ArtifactTree::Kind::kEmpty) return std::nullopt;
    const LevelClip clip{octants_near(neighbor, kind_ == Kind::kBlocked),
                         smallest_filtered(radius_)};
    return read_levels(worker.open(job_.work, place.artifact), *source_cube(cube, neighbor), memory,
                       job_.context.cancel, clip);
  }

  BuildJob& job_;
  const Kind kind_;
  const uint32_t radius_;
  const ArtifactTree tree_;
  FilledParts& result_;
  const uint32_t levels_;  // levels of the positions' grid
  const DagShape shape_;   // shape of the result's grid
  EncloseWorkers workers_;
  std::vector<Cube> cubes_;
  std::mutex mutex_;  // guards parts_
  std::vector<FilledPart> parts_;
};

}  // namespace

DagShape position_shape(const DagShape& shape) {
  DagShape out = shape;
  ++out.grid_levels;
  return out;
}

void find_blocked(BuildJob& job, const std::vector<FilledPart>& shell, FilledParts& blocked) {
  WalkPass pass(job, WalkPass::Kind::kBlocked, shell, blocked);
  pass.finish(pass.run());
}

void find_enclosed(BuildJob& job, const std::vector<FilledPart>& closed, FilledParts& solid) {
  WalkPass pass(job, WalkPass::Kind::kEnclosed, closed, solid);
  std::vector<FilledPart> parts = pass.run();
  warn_of_walks(job, parts, false);
  pass.finish(std::move(parts));
}

}  // namespace voxdag
