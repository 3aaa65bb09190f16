#include "scheduler/plan_build.h"

#include <algorithm>

#include "scheduler/check_spec.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

// Levels of the finer pilot of a plan. Large builds are extrapolated from 8192^3, which takes one
// or two seconds and, for the largest scenes, two reads of the triangles.
uint32_t plan_pilot_levels(uint32_t grid_levels) {
  return std::clamp<uint32_t>(grid_levels - std::min<uint32_t>(grid_levels, 2), 12, 13);
}

}  // namespace

Estimate plan_build(const BuildSpec& spec, const BuildContext& context) {
  const BuildSpec full = checked(spec);
  MemoryBudget budget(full.run.memory_bytes);
  StageClock clock;
  const std::string folder = full.run.work_folder.empty()
                                 ? make_temporary_folder(temporary_parent() + "/voxdag-plan-")
                                 : full.run.work_folder;
  BuildScene source(full.geometry, folder, budget, context);
  refuse_own_files(full, source, folder, {}, context);
  WorkFolder work(context, folder, full.run.lock_wait_s);
  // Removes spilled triangles. A job in the work folder is left unchanged.
  struct Cleanup {
    WorkFolder& work;
    const bool own_folder;
    ~Cleanup() { own_folder ? work.remove() : work.remove_spilled(); }
  } cleanup{work, full.run.work_folder.empty()};
  IngestCheckpoint no_checkpoints(full, nullptr, work, context);
  const PreparedScene scene = prepare_scene(full, source, budget, clock, context, no_checkpoints);
  Estimate estimate =
      estimate_build(full.geometry, scene, source, plan_pilot_levels(scene.state.grid.levels),
                     {context, full.run.threads, budget});
  estimate.free_disk = context.files.free_space(work.path());
  return estimate;
}

}  // namespace voxdag
