#include "scheduler/plan_build.h"

#include <algorithm>

#include "scheduler/check_spec.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

// Returns the number of grid levels of the finer of a plan's two pilot builds (estimate.h). Large
// builds are extrapolated from 13 levels (8192^3 voxels). This pilot takes one or two seconds. If
// the triangles do not fit in memory on this grid, they are read again for a coarser pilot.
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
  // Removes the temporary folder, or the spilled triangles in the user's work folder. A job in that
  // work folder is left unchanged.
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
