// The first stages of a build: scan and ingest read the scene, partition divides its triangles
// among the subvolumes. `plan` runs them up to the partition; merge_stage.h has the last ones.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "scheduler/build_spec.h"
#include "scheduler/ingest/ingest_checkpoint.h"
#include "scheduler/plan/top_tree.h"
#include "scheduler/stage_clock.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// A spec with its defaults filled in. Throws Error{kInvalidInput} naming the option that is wrong,
// Error{kDevice} for a backend whose device is missing.
BuildSpec checked(const BuildSpec& spec);

// Throws Error{kInvalidInput} if the scene reads one of `outputs` or a file of the work folder,
// which the build would overwrite or remove. Files that only the scene names, as its buffers, are
// looked up where no earlier build can have done so.
void refuse_own_files(const BuildSpec& spec, const std::string& work_folder,
                      std::span<const std::string> outputs, const BuildContext& context);

// A scene after ingest: its triangles, and the subvolumes they are to be partitioned to.
struct PreparedScene {
  IngestState state;
  std::unique_ptr<MemoryBudget> triangle_budget;
  std::unique_ptr<TriangleStore> triangles;
  std::vector<SubvolumePlan> plan;  // empty if an earlier run partitioned the triangles
  double max_durable_bytes = 0;     // of disk that the triangles take in a build

  // Of the grid and the snapped triangles: names the content.
  std::string digest() const { return state.digest.hex(); }
};

// Scans and ingests the scene of a checked spec and plans its subvolumes, resuming at the
// checkpoint of an earlier run; the scene is not opened if that one was past ingest. Throws
// DamagedTriangles if the stored triangles are damaged.
PreparedScene prepare_scene(const BuildSpec& spec, MemoryBudget& budget, StageClock& clock,
                            const BuildContext& context, IngestCheckpoint& checkpoint);

// Partitions the triangles to the subvolumes at `cubes`; returns the bin of each, in the same
// order. Throws DamagedTriangles if triangles are missing.
std::vector<BinId> partition_prepared(PreparedScene& scene, std::span<const Cube> cubes,
                                      IngestCheckpoint& checkpoint, const StageContext& context);

}  // namespace voxdag
