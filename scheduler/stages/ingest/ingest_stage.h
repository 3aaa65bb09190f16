// The ingest stage: stores the scene's snapped triangles, and plans the subvolumes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/spec/stage_clock.h"
#include "scheduler/stages/ingest/top_tree.h"
#include "scheduler/state/build_scene.h"
#include "scheduler/state/checkpoint/ingest_checkpoint.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// A scene after ingest: its triangles, and the subvolumes they will be partitioned into.
struct PreparedScene {
  IngestState state;
  std::unique_ptr<MemoryBudget> triangle_budget;
  std::unique_ptr<TriangleStore> triangles;
  std::vector<SubvolumePlan> plan;  // empty if an earlier run partitioned the triangles
  double max_disk_bytes = 0;        // max disk space of the stored triangles (max_disk_bytes())

  // Digest of the grid and the snapped triangles. It identifies the content.
  std::string digest() const { return state.digest.hex(); }
};

// Scans and ingests the scene of a checked spec and plans its subvolumes. Resumes at the checkpoint
// of an earlier run; if that run had finished ingest, the scene is not opened. Throws
// DamagedTriangles if the stored triangles are damaged.
PreparedScene prepare_scene(const BuildSpec& spec, BuildScene& scene, MemoryBudget& budget,
                            StageClock& clock, const BuildContext& context,
                            IngestCheckpoint& checkpoint);

}  // namespace voxdag
