#include "scheduler/stages/build/thread_builder.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "scheduler/stages/build/choose_backend.h"
#include "scheduler/stages/build/executor.h"
#include "scheduler/stages/partition/partition_stage.h"
#include "scheduler/stages/rows/prepare_rows.h"

namespace voxdag {
namespace {

ExecutorOptions executor_options(BuildJob& job, const BackendChoice& backend) {
  const RunOptions& run = job.spec.run;
  ExecutorOptions options;
  options.shape = job.shape();
  options.rule = job.spec.geometry.rule();
  options.threads = std::min(run.threads, backend.max_workers);
  options.open_backend = backend.open;
  if (run.subvolume_edge) options.longest_edge = static_cast<int64_t>(run.subvolume_edge);
  options.segment_folder = job.work.path();
  options.first_segment_id = job.work.next_segment_id();
  options.checkpoint_interval_s = run.checkpoint_interval_s;
  options.rows = job.rows.get();
  if (job.cache) options.cache = &*job.cache;
  options.built = job.report.subvolumes_reused;
  return options;
}

}  // namespace

void ThreadBuilder::build(PreparedScene& scene, std::span<const StoredSubvolume> planned) {
  std::vector<Cube> cubes;
  double bricks = 0;
  for (const StoredSubvolume& subvolume : planned) {
    cubes.push_back(subvolume.cube);
    bricks += subvolume.weight;
  }
  const std::vector<BinId> bins = partition_prepared(scene, cubes, job_.checkpoint, job_.stage());
  std::vector<QueuedSubvolume> queue;
  for (size_t i = 0; i < planned.size(); ++i) queue.push_back({planned[i], bins[i]});
  const MemoryCharge lists(job_.budget, queue.size() * (sizeof queue[0] + sizeof planned[0]),
                           "lists of subvolumes");
  job_.clock.finish("partition");
  prepare_rows(job_, planned, bins, *scene.triangles);
  Progress& progress = job_.context.progress;
  RunOptions run = job_.spec.run;
  if (job_.rows) run.backend = BackendName::kCpu;  // the only backend that fills solids
  const BackendChoice backend = choose_backend(run, job_.spec.geometry.rule(), bricks, progress);
  job_.report.backend = backend.name;
  const ExecutorOptions options = executor_options(job_, backend);
  progress.begin_stage("build", options.built + queue.size(), "subvolumes");
  progress.resume_at(options.built);
  const ExecutorCounts counts =
      build_subvolumes(options, std::move(queue), *scene.triangles, *job_.store, job_.commits,
                       job_.budget, job_.context);
  job_.checkpoint.finish();
  job_.report.spill_bytes += scene.triangles->file_bytes();
  scene.triangles.reset();  // Freeing a large file takes time, which belongs to this stage.
  job_.report.subvolumes_split += counts.split;
  job_.report.subvolumes_cached += counts.cached;
  job_.report.subvolumes_reused += counts.cached;
  progress.end_stage();
  job_.clock.finish("build");
}

}  // namespace voxdag
