#include "scheduler/stages/partition/partition_stage.h"

#include "core/base/process_limits.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/partition/partition.h"

namespace voxdag {

std::vector<BinId> partition_prepared(PreparedScene& scene, std::span<const Cube> cubes,
                                      IngestCheckpoint& checkpoint, const StageContext& context) {
  const size_t buffer_bytes = MemoryPlan::divide(context.budget.limit()).partition_buffer_bytes;
  IngestState& state = scene.state;
  TriangleStore& triangles = *scene.triangles;
  if (state.stage < IngestStage::kReady) {
    partition_scene(triangles, state.grid.levels, cubes, buffer_bytes, state.position, context,
                    [&](uint64_t copied, BinWriter& writer) {
                      state.position = copied;
                      if (!checkpoint.is_due()) return;
                      writer.flush();
                      checkpoint.save_in_background(state);
                    });
    state.stage = IngestStage::kReady;
    state.top_tree = {};
    checkpoint.save(state);
    triangles.release(kSceneBin);
  }
  const auto bins = assign_bins(triangles, state.grid.levels, cubes, buffer_bytes, context);
  // Chunks of triangles are small heap blocks. Without this call, their memory would remain
  // resident after it was freed.
  trim_heap();
  return bins;
}

}  // namespace voxdag
