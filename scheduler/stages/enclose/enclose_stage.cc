#include "scheduler/stages/enclose/enclose_stage.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/dag/space/enclosed_fill.h"
#include "core/dag/space/face_code.h"
#include "core/format/artifact/artifact_writer.h"
#include "core/geometry/octree_descent.h"
#include "scheduler/solid/full_cubes.h"
#include "scheduler/solid/seed.h"
#include "scheduler/solid/solid_report.h"
#include "scheduler/spec/memory_plan.h"
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

// Memory and files of a worker.
struct EncloseWorker {
  EncloseWorker(MemoryBudget& budget, uint64_t share_bytes) : share(share_bytes, &budget) {}

  MemoryBudget share;
  PagePool pool;
  std::map<uint32_t, std::shared_ptr<ReadableFile>> segments;
  std::unique_ptr<SegmentWriter> filled;
  std::vector<FilledPart> done;  // parts in `filled` that are not durable
  double saved_s = wall_seconds();
};

class Enclosure {
 public:
  Enclosure(BuildJob& job, const std::set<Cube>& too_large)
      : job_(job), too_large_(too_large), seed_(seed_of(job.spec.geometry, job.report.grid)) {}

  void run() {
    const std::vector<StoredSubvolume> leaves = shell();
    job_.context.progress.begin_stage("enclose", 2 * leaves.size(), "subvolumes");
    begin_workers();
    label(leaves);
    const OutsideSpace outside = find_outside(parts_, *faces_, seed_, job_.shape().grid_levels,
                                              job_.budget, job_.context.cancel);
    remove_faces();
    fill(outside);
    finish(outside);
    job_.context.progress.end_stage();
  }

 private:
  std::vector<StoredSubvolume> shell() const {
    std::vector<StoredSubvolume> leaves = job_.store->leaves();
    std::erase_if(leaves, [](const StoredSubvolume& s) { return s.summary.empty(); });
    return leaves;
  }

  void begin_workers() {
    const uint64_t free_bytes = job_.budget.available();
    kept_budget_.emplace(MemoryPlan::kept_label_bytes(free_bytes), &job_.budget);
    // Leaves 1/8 of the remaining memory for the components at the faces (find_outside()).
    const auto memory =
        WorkerMemory::divide((free_bytes - kept_budget_->limit()) / 8 * 7, job_.spec.run.threads);
    const uint32_t first_segment = job_.work.next_segment_id();
    for (unsigned i = 0; i < memory.workers; ++i) {
      workers_.push_back(std::make_unique<EncloseWorker>(job_.budget, memory.share_bytes));
      workers_.back()->filled = std::make_unique<SegmentWriter>(
          job_.context.files, job_.work.path(), first_segment + i, job_.budget);
    }
    job_.context.files.create(job_.work.faces_path());
    faces_ = std::make_unique<RowFile>(job_.context.files, job_.work.faces_path(), 0);
  }

  void label(const std::vector<StoredSubvolume>& leaves) {
    parallel_for(static_cast<unsigned>(workers_.size()), leaves.size(),
                 [&](unsigned worker, size_t i) {
                   label_part(*workers_[worker], leaves[i].cube, leaves[i].artifact);
                   job_.context.progress.advance(1);
                 });
    std::ranges::sort(parts_, {}, &LabeledPart::cube);
  }

  // Labels the components of a cube's empty space. Labels the cube's octants separately instead if
  // the cube does not fit in memory, or if the artifact has separate roots inside the cube.
  void label_part(EncloseWorker& worker, const Cube& cube, const ArtifactRef& shell) {
    job_.context.cancel.check();
    const bool is_smallest = cube.edge_voxels(job_.shape().grid_levels) <= kSmallestEdge;
    const ArtifactReader artifact = open(worker, shell);
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
        if (is_smallest) refuse_memory(worker);
      }
    for (int octant = 0; octant < 8; ++octant) label_part(worker, cube.child(octant), shell);
  }

  // Labels a cube with at most 1/`divisor` of the worker's share. Filling the cube later needs more
  // memory than labeling it, so a cube that needs more for its labels would not fit then. Throws
  // OutOfBudget.
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
    const auto voxel = seed_in(seed_, cube, job_.shape().grid_levels);
    if (!voxel) return std::nullopt;
    const SeedPlace place = find_seed(labels, *voxel);
    if (place.kind == SeedPlace::Kind::kSet) refuse_seed_in_shell(*seed_);
    if (place.kind == SeedPlace::Kind::kClosed) return std::nullopt;
    return place.component;
  }

  ArtifactReader open(EncloseWorker& worker, const ArtifactRef& shell) const {
    auto& segment = worker.segments[shell.segment];
    if (!segment) segment = job_.work.open_segment(shell.segment);
    return {segment, shell};
  }
  std::optional<NodeLevels> read(EncloseWorker& worker, const Cube& cube, const ArtifactRef& shell,
                                 PooledMemory& memory) const {
    return read_levels(open(worker, shell), cube, memory, job_.context.cancel);
  }

  [[noreturn]] static void refuse_memory(const EncloseWorker& worker) {
    throw Error(ErrorCode::kOutOfMemory, "the empty space of a subvolume of " +
                                             std::to_string(kSmallestEdge) +
                                             " voxels per edge does not fit a worker's share of " +
                                             std::to_string(worker.share.limit()) +
                                             " bytes: expected more memory (--memory)");
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
                   if (!job_.filled->find(parts_[i].cube))
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
      const DagShape shape = job_.shape();
      SubDagTables tables(memory, static_cast<int>(shape.grid_levels - part.cube.level));
      if (seed_)
        fill_from_seed(memory, labels, is_outside, seed_in(seed_, part.cube, shape.grid_levels),
                       tables);
      else
        fill_enclosed(memory, labels, is_outside, tables);
      worker.done.push_back(write_part(worker, part.cube, tables));
    } catch (const OutOfBudget&) {
      if (part.cube.edge_voxels(job_.shape().grid_levels) <= kSmallestEdge) refuse_memory(worker);
      throw PartTooLarge{part.cube};
    }
    if (wall_seconds() - worker.saved_s >= job_.spec.run.checkpoint_interval_s) save(worker);
  }

  FilledPart write_part(EncloseWorker& worker, const Cube& cube, SubDagTables& tables) {
    const DagShape shape = job_.shape();
    ArtifactWriter writer(*worker.filled, shape);
    const SubDagSummary summary =
        emit_levels(tables, {cube.level, shape.grid_levels, shape.hash_bits}, writer);
    const ArtifactRoot root{cube, 0, summary.root_hash, summary.voxels, summary.svo_nodes};
    return {cube, writer.finish({&root, 1}), summary.voxels};
  }

  // Makes the filled parts of a worker durable.
  void save(EncloseWorker& worker) {
    worker.filled->sync();
    job_.filled->add_durable(std::exchange(worker.done, {}));
    worker.saved_s = wall_seconds();
    is_long_ = true;
  }

  // Collects all filled parts, adds the empty cubes outside the parts that are enclosed (as full
  // cubes), and marks FilledParts as complete.
  void finish(const OutsideSpace& outside) {
    std::vector<FilledPart> all;
    for (const LabeledPart& part : parts_)
      if (const auto filled = job_.filled->find(part.cube)) all.push_back(*filled);
    for (const auto& worker : workers_)
      all.insert(all.end(), worker->done.begin(), worker->done.end());
    if (!outside.enclosed_cubes.empty()) {
      const ArtifactRef artifact =
          add_full_cubes(*workers_[0]->filled, job_.shape(), outside.enclosed_cubes);
      for (const Cube& cube : outside.enclosed_cubes) all.push_back(full_part(cube, artifact));
    }
    std::vector<std::unique_ptr<SegmentWriter>> segments;
    for (const auto& worker : workers_) {
      worker->filled->complete();
      segments.push_back(std::move(worker->filled));
    }
    warn_of_walks(outside, all);
    job_.filled->complete(std::move(all), std::move(segments));
    if (is_long_) job_.filled->save();
  }

  FilledPart full_part(const Cube& cube, const ArtifactRef& artifact) const {
    const int size = static_cast<int>(job_.shape().grid_levels - cube.level);
    return {cube, artifact, full_counts(size).voxels};
  }

  // Warns if nothing is enclosed, or if a walk leads from the seed to the border.
  void warn_of_walks(const OutsideSpace& outside, const std::vector<FilledPart>& all) const {
    const std::string& scene = job_.spec.geometry.scenes.front();
    if (outside.is_seed_outside) job_.context.progress.warn_of_input(seed_warning(*seed_, scene));
    if (seed_) return;
    uint64_t voxels = 0, shell_voxels = 0;
    for (const FilledPart& part : all) voxels += part.voxels;
    for (const StoredSubvolume& leaf : job_.store->leaves()) shell_voxels += leaf.summary.voxels;
    if (shell_voxels == 0) return;
    const SolidReport report = enclosed_report(voxels, shell_voxels);
    if (const auto warning = solid_warning(report, scene))
      job_.context.progress.warn_of_input(*warning);
  }

  BuildJob& job_;
  const std::set<Cube>& too_large_;
  const std::optional<Seed> seed_;
  std::vector<std::unique_ptr<EncloseWorker>> workers_;
  std::unique_ptr<RowFile> faces_;
  std::mutex mutex_;  // guards parts_ while labels are computed, and kept_
  std::vector<LabeledPart> parts_;
  std::optional<MemoryBudget> kept_budget_;
  std::map<Cube, std::unique_ptr<LabeledSpace>> kept_;  // labels that are not computed again
  std::atomic<bool> is_long_ = false;  // some parts were saved, so finish() saves the record
};

}  // namespace

void enclose(BuildJob& job) {
  if (!job.filled || job.filled->is_complete()) return;
  std::set<Cube> too_large;
  while (!job.filled->is_complete()) try {
      Enclosure(job, too_large).run();
    } catch (const PartTooLarge& part) {
      too_large.insert(part.cube);
    }
  job.clock.finish("enclose");
}

}  // namespace voxdag
