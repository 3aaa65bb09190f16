// A worker of the stage `enclose`, with its memory and its files, and functions that end a pass
// over the parts of the grid.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/dag/consing/sub_dag_tables.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/segment_writer.h"
#include "scheduler/solid/filled_parts.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

class EncloseWorker {
 public:
  EncloseWorker(BuildJob& job, uint64_t share_bytes, uint32_t segment);

  ArtifactReader open(const WorkFolder& work, const ArtifactRef& artifact);
  // Writes the sub-DAG in `tables`, the result for the part `cube`, to `filled` as an artifact.
  // Adds the part to `done`. Throws OutOfBudget.
  void add(const Cube& cube, const DagShape& shape, SubDagTables& tables);
  // True if the last save() was more than a checkpoint interval ago.
  bool is_due(const BuildJob& job) const;
  // Makes the parts in `done` durable, and moves them to `result`.
  void save(FilledParts& result);
  // Throws Error{kOutOfMemory}: even a part of the smallest edge does not fit in the worker's share
  // of the memory.
  [[noreturn]] void refuse_memory() const;

  MemoryBudget share;
  PagePool pool;
  std::unique_ptr<SegmentWriter> filled;
  std::vector<FilledPart> done;  // parts in `filled` that are not durable
  bool has_saved = false;

 private:
  std::map<uint32_t, std::shared_ptr<ReadableFile>> segments_;
  double saved_s_;
};

using EncloseWorkers = std::vector<std::unique_ptr<EncloseWorker>>;

// Makes the workers that `memory` allows. Each worker writes to a new segment.
EncloseWorkers make_enclose_workers(BuildJob& job, const WorkerMemory& memory);

// Passes `parts` to result.complete(). Their artifacts are in segments of the workers or of earlier
// runs. If the pass took so long that a worker has called save(), also makes the complete record
// durable.
void complete_pass(FilledParts& result, std::vector<FilledPart> parts, EncloseWorkers& workers);

// Warns if the solid in `filled` has no interior. In a build with a seed, also warns if
// `is_seed_outside` is true.
void warn_of_walks(BuildJob& job, const std::vector<FilledPart>& filled, bool is_seed_outside);

}  // namespace voxdag
