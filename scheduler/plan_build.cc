#include "scheduler/plan_build.h"

#include <optional>

#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/fields/field.h"
#include "core/io/outputs/space_reserve.h"
#include "core/io/temporary_paths.h"
#include "scheduler/check_spec.h"
#include "scheduler/solid/seed.h"
#include "scheduler/state/job/empty_scene.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

void warn_of_empty_scene(const BuildSpec& spec, const IngestState& state, Progress& progress) {
  const std::string reason = empty_scene_reason(
      {state.declared_triangles, state.counts.dropped_invalid, state.counts.dropped_outside},
      state.grid);
  progress.warn_of_input(
      {"empty-scene", joined(spec.geometry.scenes),
       reason + (spec.run.allow_empty ? "; the file will have no nodes" : "; a build refuses it")});
}

// Throws Error if a build would refuse the seed.
void check_seed(const GeometryOptions& options, const PreparedScene& scene,
                const CancelToken& cancel) {
  const auto seed = seed_of(options, scene.state.grid);
  if (!seed) return;
  const auto triangles = scene.triangles->open(kSceneBin);
  if (is_in_shell(*seed, scene.state.grid.levels, *triangles, cancel)) refuse_seed_in_shell(*seed);
}

// Throws Error for a plan without builds at coarse resolutions, from which it would extrapolate.
[[noreturn]] void refuse_memory(const RunOptions& run, const Estimate& estimate) {
  throw Error(ErrorCode::kOutOfMemory,
              "the memory budget of " + size_text(run.memory_bytes) +
                  " is too small for an estimate, which builds the scene of " +
                  count_text(estimate.triangles) +
                  " triangles at coarse resolutions in memory: expected a larger " +
                  option_text("memory"));
}

}  // namespace

Estimate plan_build(const BuildSpec& spec, const BuildContext& caller) {
  const BuildSpec full = checked(with_resolution(spec, caller));
  SpaceReserve files(caller.files, full.run.min_free_bytes);
  const BuildContext context{files, caller.progress, caller.cancel};
  MemoryBudget budget(full.run.memory_bytes);
  StageClock clock;
  const std::string folder = full.run.work_folder.empty()
                                 ? make_temporary_folder(temporary_parent() + "/voxdag-plan-")
                                 : full.run.work_folder;
  std::optional<TemporaryPath> registered;
  if (full.run.work_folder.empty()) registered.emplace(folder);
  BuildScene source(full.geometry, folder, budget, context);
  refuse_own_files(full, source, folder, {}, context);
  WorkFolder work(context, folder, full.run.lock_wait_s);
  // Removes the work folder if it is temporary. In a work folder that the user has chosen, removes
  // only the spilled triangles, and keeps the job store.
  struct Cleanup {
    WorkFolder& work;
    const bool own_folder;
    ~Cleanup() { own_folder ? work.remove() : work.remove_spilled(); }
  } cleanup{work, full.run.work_folder.empty()};
  IngestCheckpoint no_checkpoints(full, nullptr, work, context);
  const PreparedScene scene = prepare_scene(full, source, budget, clock, context, no_checkpoints);
  check_seed(full.geometry, scene, context.cancel);
  Estimate estimate = estimate_build(full, scene, source, {context, full.run.threads, budget});
  if (estimate.pilot_resolution == 0) refuse_memory(full.run, estimate);
  if (scene.state.counts.triangles == 0) warn_of_empty_scene(full, scene.state, context.progress);
  if (estimate.solid && estimate.solid->warning)
    context.progress.warn_of_input(*estimate.solid->warning);
  estimate.free_disk = context.files.free_space(work.path());
  return estimate;
}

}  // namespace voxdag
