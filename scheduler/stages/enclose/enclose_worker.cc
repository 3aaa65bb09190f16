#include "scheduler/stages/enclose/enclose_worker.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/backend/backend.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/artifact/artifact_writer.h"
#include "scheduler/solid/seed.h"
#include "scheduler/solid/solid_report.h"

namespace voxdag {

EncloseWorker::EncloseWorker(BuildJob& job, uint64_t share_bytes, uint32_t segment)
    : share(share_bytes, &job.budget),
      filled(
          std::make_unique<SegmentWriter>(job.context.files, job.work.path(), segment, job.budget)),
      saved_s_(wall_seconds()) {}

ArtifactReader EncloseWorker::open(const WorkFolder& work, const ArtifactRef& artifact) {
  auto& segment = segments_[artifact.segment];
  if (!segment) segment = work.open_segment(artifact.segment);
  return {segment, artifact};
}

void EncloseWorker::add(const Cube& cube, const DagShape& shape, SubDagTables& tables) {
  ArtifactWriter writer(*filled, shape);
  const SubDagSummary summary =
      emit_levels(tables, {cube.level, shape.grid_levels, shape.hash_bits}, writer);
  const ArtifactRoot root{cube, 0, summary.root_hash, summary.voxels, summary.svo_nodes};
  done.push_back({cube, writer.finish({&root, 1}), summary.voxels});
}

bool EncloseWorker::is_due(const BuildJob& job) const {
  return wall_seconds() - saved_s_ >= job.spec.run.checkpoint_interval_s;
}

void EncloseWorker::save(FilledParts& result) {
  filled->sync();
  result.add_durable(std::exchange(done, {}));
  saved_s_ = wall_seconds();
  has_saved = true;
}

void EncloseWorker::refuse_memory() const {
  throw Error(ErrorCode::kOutOfMemory,
              "the empty space of a subvolume of " + std::to_string(kSmallestEdge) +
                  " voxels per edge does not fit a worker's share of " +
                  std::to_string(share.limit()) + " bytes: expected more memory (" +
                  option_text("memory") + ")");
}

EncloseWorkers make_enclose_workers(BuildJob& job, const WorkerMemory& memory) {
  const uint32_t first_segment = job.work.next_segment_id();
  EncloseWorkers workers;
  for (unsigned i = 0; i < memory.workers; ++i)
    workers.push_back(std::make_unique<EncloseWorker>(job, memory.share_bytes, first_segment + i));
  return workers;
}

void complete_pass(FilledParts& result, std::vector<FilledPart> parts, EncloseWorkers& workers) {
  const bool is_long =
      std::ranges::any_of(workers, [](const auto& worker) { return worker->has_saved; });
  std::vector<std::unique_ptr<SegmentWriter>> segments;
  for (const auto& worker : workers) {
    worker->filled->complete();
    segments.push_back(std::move(worker->filled));
  }
  result.complete(std::move(parts), std::move(segments));
  if (is_long) result.save();
}

void warn_of_walks(BuildJob& job, const std::vector<FilledPart>& filled, bool is_seed_outside) {
  const std::string& scene = job.spec.geometry.scenes.front();
  const auto seed = seed_of(job.spec.geometry, job.report.grid);
  if (is_seed_outside) job.context.progress.warn_of_input(seed_warning(*seed, scene));
  if (seed) return;
  uint64_t voxels = 0, shell_voxels = 0;
  for (const FilledPart& part : filled) voxels += part.voxels;
  for (const StoredSubvolume& leaf : job.store->leaves()) shell_voxels += leaf.summary.voxels;
  if (shell_voxels == 0) return;
  const SolidReport report = enclosed_report(voxels, shell_voxels);
  if (const auto warning = solid_warning(report, scene))
    job.context.progress.warn_of_input(*warning);
}

}  // namespace voxdag
