// The shared state of a build's stages: its spec, locks, durable state and report. While it exists,
// no other build can use the output or the work folder.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/dag/sub_dag.h"
#include "scheduler/solid/filled_parts.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_report.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/spec/stage_clock.h"
#include "scheduler/state/artifact_cache.h"
#include "scheduler/state/build_locks.h"
#include "scheduler/state/build_scene.h"
#include "scheduler/state/checkpoint/ingest_checkpoint.h"
#include "scheduler/state/commit_queue.h"
#include "scheduler/state/job_progress.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {

struct BuildJob {
  // Takes the locks and opens the job store. With RunOptions::restart an unreadable job store is
  // replaced. The references must outlive this object.
  BuildJob(const BuildSpec& spec, BuildScene& scene, MemoryBudget& budget,
           const BuildContext& context);

  StageContext stage() const { return {context, spec.run.threads, budget}; }
  DagShape shape() const {
    return {.grid_levels = report.grid.levels, .hash_bits = spec.geometry.hash_bits};
  }
  // Returns the subvolumes that are not built yet.
  std::vector<StoredSubvolume> planned() const;
  // Returns true if the build is solid and its rows are complete. Throws Error{kCorrupt} if they
  // are missing although subvolumes were built.
  bool has_rows() const;
  // Records finished work. Errors are ignored: the caller already handles an error, and subvolumes
  // that are not recorded are only built again.
  void commit_best_effort();
  // Throws Error{kInvalidInput}: the work folder contains another job. `difference` tells how the
  // jobs differ.
  [[noreturn]] void refuse(const std::string& difference) const;

  const BuildSpec& spec;
  BuildScene& scene;
  MemoryBudget& budget;
  const OutputLock output_lock;
  WorkFolder work;
  std::unique_ptr<JobStore> store;
  std::optional<ArtifactCache> cache;
  CommitQueues commits;
  StageClock clock{[this](const StageTime& stage) { store->add_stage_time(stage); }};
  JobProgress progress;
  const BuildContext context;
  IngestCheckpoint checkpoint;
  BuildReport report;
  // Null unless the solid's rule needs sample rows and the scene was read.
  std::unique_ptr<SolidRows> rows;
  // Null unless the solid is enclosed and the scene was read.
  std::unique_ptr<FilledParts> filled;
  // The blocked and the closed positions of a walking cube (stages/enclose/cube_walks.h). Null in
  // builds without a radius, and before the scene is read.
  std::unique_ptr<FilledParts> blocked, closed;
  bool start_over;  // the stored job is ignored
};

// Returns the work folder of a build with these options.
std::string work_folder_of(const RunOptions& options);

}  // namespace voxdag
