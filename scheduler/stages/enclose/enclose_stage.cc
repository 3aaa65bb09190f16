#include "scheduler/stages/enclose/enclose_stage.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/parallel_for.h"
#include "core/dag/space/enclosed_fill.h"
#include "core/dag/space/face_code.h"
#include "core/geometry/octree_descent.h"
#include "scheduler/solid/full_cubes.h"
#include "scheduler/solid/seed.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/enclose/cube_walks.h"
#include "scheduler/stages/enclose/enclose_worker.h"
#include "scheduler/stages/enclose/join_parts.h"
#include "scheduler/stages/enclose/read_levels.h"

namespace voxdag {
namespace {

// Estimated maximum memory of a part's nodes and labels, per byte of its artifact.
constexpr uint64_t kLabelsOverArtifact = 16;

// Thrown if a part was labeled, but its filled sub-DAG does not fit the memory of a worker.
struct PartTooLarge {
  Cube cube;
};

// A part of the grid in memory: its nodes and the labels of its empty space.
struct LabeledSpace {
  // The pages come from `pool`, or from a pool of this object if `pool` is null.
  LabeledSpace(uint64_t limit_bytes, MemoryBudget& parent, PagePool* pool)
      : budget(limit_bytes, &parent), memory{budget, pool ? *pool : own_pool} {}

  MemoryBudget budget;
  PagePool own_pool;
  PooledMemory memory;
  std::optional<NodeLevels> levels;
  std::optional<SpaceLabels> labels;
};

// Returns the seed of the build, if any, in the grid with this shape: the grid of the voxels, or
// the grid of the positions (cube_walks.h).
std::optional<Seed> start_of_walks(const BuildJob& job, const DagShape& shape) {
  std::optional<Seed> seed = seed_of(job.spec.geometry, job.report.grid);
  if (seed && shape != job.shape())
    seed->voxel = start_position(*seed, seed->radius, job.shape().grid_levels);
  return seed;
}

class Enclosure {
 public:
  // Fills the empty space that `walls` enclose. `shape` is the shape of the grid that has the
  // walls. Passes the filled parts to result.complete().
  Enclosure(BuildJob& job, const std::set<Cube>& too_large, const std::vector<FilledPart>& walls,
            const DagShape& shape, FilledParts& result)
      : job_(job),
        too_large_(too_large),
        walls_(walls),
        shape_(shape),
        result_(result),
        seed_(start_of_walks(job, shape)) {}

  void run() {
    job_.context.progress.begin_stage("enclose", 2 * walls_.size(), "subvolumes");
    begin_workers();
    label();
    const OutsideSpace outside =
        find_outside(parts_, *faces_, seed_, shape_.grid_levels, job_.budget, job_.context.cancel);
    remove_faces();
    fill(outside);
    finish(outside);
    job_.context.progress.end_stage();
  }

 private:
  void begin_workers() {
    const uint64_t free_bytes = job_.budget.available();
    kept_budget_.emplace(MemoryPlan::kept_label_bytes(free_bytes), &job_.budget);
    // Leaves 1/8 of the remaining memory for the components at the faces (find_outside()).
    const auto memory =
        WorkerMemory::divide((free_bytes - kept_budget_->limit()) / 8 * 7, job_.spec.run.threads);
    workers_ = make_enclose_workers(job_, memory);
    job_.context.files.create(job_.work.faces_path());
    faces_ = std::make_unique<RowFile>(job_.context.files, job_.work.faces_path(), 0);
  }

  void label() {
    parallel_for(static_cast<unsigned>(workers_.size()), walls_.size(),
                 [&](unsigned worker, size_t i) {
                   label_part(*workers_[worker], walls_[i].cube, walls_[i].artifact);
                   job_.context.progress.advance(1);
                 });
    std::ranges::sort(parts_, {}, &LabeledPart::cube);
  }

  // Labels the components of a cube's empty space. Labels the cube's octants separately instead if
  // the cube does not fit in memory, or if the artifact has separate roots inside the cube.
  void label_part(EncloseWorker& worker, const Cube& cube, const ArtifactRef& shell) {
    job_.context.cancel.check();
    const bool is_smallest = cube.edge_voxels(shape_.grid_levels) <= kSmallestEdge;
    const ArtifactReader artifact = worker.open(job_.work, shell);
    const auto has_root = [&](const auto& is_related) {
      return std::ranges::any_of(artifact.roots(), is_related);
    };
    const bool has_parts = has_root([&](const ArtifactRoot& root) {
      return root.cube.level > cube.level && contains(cube, root.cube);
    });
    if (!has_parts &&
        !has_root([&](const ArtifactRoot& root) { return contains(root.cube, cube); }))
      return;
    if (!has_parts && !too_large_.contains(cube)) try {
        return try_label(worker, cube, shell, is_smallest ? 2 : 3);
      } catch (const OutOfBudget&) {
        if (is_smallest) worker.refuse_memory();
      }
    for (int octant = 0; octant < 8; ++octant) label_part(worker, cube.child(octant), shell);
  }

  // Labels a cube in at most 1/`divisor` of the worker's share of the memory. Throws OutOfBudget if
  // this is not enough. Filling the cube later needs more memory than labeling it, so such a cube
  // would not fit in the share.
  void try_label(EncloseWorker& worker, const Cube& cube, const ArtifactRef& shell,
                 uint64_t divisor) {
    const uint64_t limit = worker.share.limit() / divisor;
    auto kept = label_to_keep(worker, cube, shell, limit);
    const auto space =
        kept ? nullptr : label_space(worker, cube, shell, limit, worker.share, &worker.pool);
    if (!kept && !space) return;
    const SpaceLabels& labels = *(kept ? kept : space)->labels;
    LabeledPart part{cube, shell, {}, seed_component(labels, cube), {}};
    part.touch.assign(labels.touch(0, 0), labels.touch(0, 0) + labels.count(0, 0));
    for (int face = 0; face < kFaces; ++face)
      part.faces[face] = faces_->append(encode_face(labels, face, worker.share.limit() / 16));
    const std::lock_guard lock(mutex_);
    parts_.push_back(std::move(part));
    if (kept) kept_[cube] = std::move(kept);
  }

  // Reads a part and labels its empty space. Returns null if the part has no voxels.
  std::unique_ptr<LabeledSpace> label_space(EncloseWorker& worker, const Cube& cube,
                                            const ArtifactRef& shell, uint64_t limit_bytes,
                                            MemoryBudget& parent, PagePool* pool) const {
    auto space = std::make_unique<LabeledSpace>(limit_bytes, parent, pool);
    space->levels = read(worker, cube, shell, space->memory);
    if (!space->levels) return nullptr;
    space->labels.emplace(space->memory, *space->levels);
    return space;
  }

  // Labels a part in the memory of kept_budget_, where the labels can remain until fill_part() uses
  // them. Returns null if this memory has no room for them, or if the part has no voxels.
  std::unique_ptr<LabeledSpace> label_to_keep(EncloseWorker& worker, const Cube& cube,
                                              const ArtifactRef& shell, uint64_t limit_bytes) {
    if (kept_budget_->available() / kLabelsOverArtifact < shell.bytes) return nullptr;
    try {
      auto space = label_space(worker, cube, shell, limit_bytes, *kept_budget_, nullptr);
      if (space) space->own_pool.clear();
      return space;
    } catch (const OutOfBudget&) {
      return nullptr;
    }
  }
  std::unique_ptr<LabeledSpace> take_kept(const Cube& cube) {
    const std::lock_guard lock(mutex_);
    const auto found = kept_.find(cube);
    return found == kept_.end() ? nullptr : std::move(found->second);
  }

  // Returns the component with the seed if this component reaches a face of the cube. Throws
  // Error{kInvalidInput} if the seed's voxel is set.
  std::optional<uint32_t> seed_component(const SpaceLabels& labels, const Cube& cube) const {
    const auto voxel = seed_in(seed_, cube, shape_.grid_levels);
    if (!voxel) return std::nullopt;
    const SeedPlace place = find_seed(labels, *voxel);
    if (place.kind == SeedPlace::Kind::kSet) refuse_seed_in_shell(*seed_);
    if (place.kind == SeedPlace::Kind::kClosed) return std::nullopt;
    return place.component;
  }

  std::optional<NodeLevels> read(EncloseWorker& worker, const Cube& cube, const ArtifactRef& shell,
                                 PooledMemory& memory) const {
    return read_levels(worker.open(job_.work, shell), cube, memory, job_.context.cancel);
  }

  void remove_faces() {
    faces_.reset();
    job_.context.files.remove(job_.work.faces_path());
  }

  void fill(const OutsideSpace& outside) {
    job_.context.progress.set_total(2 * parts_.size());
    parallel_for(static_cast<unsigned>(workers_.size()), parts_.size(),
                 [&](unsigned worker, size_t i) {
                   job_.context.cancel.check();
                   if (!result_.find(parts_[i].cube))
                     fill_part(*workers_[worker], parts_[i], outside.of_parts[i]);
                   job_.context.progress.advance(1);
                 });
  }

  void fill_part(EncloseWorker& worker, const LabeledPart& part,
                 const std::vector<uint8_t>& is_outside) {
    try {
      auto space = take_kept(part.cube);
      if (!space)
        space = label_space(worker, part.cube, part.shell, worker.share.limit(), worker.share,
                            &worker.pool);
      if (!space) return;
      SpaceLabels& labels = *space->labels;
      PooledMemory memory{worker.share, worker.pool};
      SubDagTables tables(memory, static_cast<int>(shape_.grid_levels - part.cube.level));
      if (seed_)
        fill_from_seed(memory, labels, is_outside, seed_in(seed_, part.cube, shape_.grid_levels),
                       tables);
      else
        fill_enclosed(memory, labels, is_outside, tables);
      worker.add(part.cube, shape_, tables);
    } catch (const OutOfBudget&) {
      if (part.cube.edge_voxels(shape_.grid_levels) <= kSmallestEdge) worker.refuse_memory();
      throw PartTooLarge{part.cube};
    }
    if (worker.is_due(job_)) worker.save(result_);
  }

  // Collects all filled parts. Adds the enclosed empty cubes between the parts as full cubes.
  // Completes result_ with these parts.
  void finish(const OutsideSpace& outside) {
    std::vector<FilledPart> all;
    for (const LabeledPart& part : parts_)
      if (const auto filled = result_.find(part.cube)) all.push_back(*filled);
    if (!outside.enclosed_cubes.empty()) {
      const ArtifactRef artifact =
          add_full_cubes(*workers_[0]->filled, shape_, outside.enclosed_cubes);
      for (const Cube& cube : outside.enclosed_cubes) all.push_back(full_part(cube, artifact));
    }
    for (const auto& worker : workers_)
      all.insert(all.end(), worker->done.begin(), worker->done.end());
    if (seed_ || &result_ == job_.filled.get()) warn_of_walks(job_, all, outside.is_seed_outside);
    complete_pass(result_, std::move(all), workers_);
  }

  FilledPart full_part(const Cube& cube, const ArtifactRef& artifact) const {
    const int size = static_cast<int>(shape_.grid_levels - cube.level);
    return {cube, artifact, full_counts(size).voxels};
  }

  BuildJob& job_;
  const std::set<Cube>& too_large_;
  const std::vector<FilledPart>& walls_;
  const DagShape shape_;
  FilledParts& result_;
  const std::optional<Seed> seed_;
  std::vector<std::unique_ptr<EncloseWorker>> workers_;
  std::unique_ptr<RowFile> faces_;
  std::mutex mutex_;  // guards parts_ while labels are computed, and kept_
  std::vector<LabeledPart> parts_;
  std::optional<MemoryBudget> kept_budget_;
  std::map<Cube, std::unique_ptr<LabeledSpace>> kept_;  // labels kept for fill_part()
};

// Fills the empty space that `walls` enclose, and passes the filled parts to result.complete(). If
// a part does not fit in memory, starts over with this part divided.
void enclose_space(BuildJob& job, const std::vector<FilledPart>& walls, const DagShape& shape,
                   FilledParts& result) {
  std::set<Cube> too_large;
  while (!result.is_complete()) try {
      Enclosure(job, too_large, walls, shape, result).run();
    } catch (const PartTooLarge& part) {
      too_large.insert(part.cube);
    }
}

std::vector<FilledPart> shell_parts(const BuildJob& job) {
  std::vector<FilledPart> parts;
  for (const StoredSubvolume& leaf : job.store->leaves())
    if (!leaf.summary.empty()) parts.push_back({leaf.cube, leaf.artifact, leaf.summary.voxels});
  return parts;
}

// Fills the space that a walking cube cannot cover (cube_walks.h).
void enclose_by_cube(BuildJob& job) {
  FilledParts &blocked = *job.blocked, &closed = *job.closed;
  if (!closed.is_complete()) {
    if (!blocked.is_complete()) find_blocked(job, shell_parts(job), blocked);
    enclose_space(job, blocked.parts(), position_shape(job.shape()), closed);
  }
  find_enclosed(job, closed.parts(), *job.filled);
}

}  // namespace

void enclose(BuildJob& job) {
  if (!job.filled || job.filled->is_complete()) return;
  if (job.blocked)
    enclose_by_cube(job);
  else
    enclose_space(job, shell_parts(job), job.shape(), *job.filled);
  job.clock.finish("enclose");
}

}  // namespace voxdag
