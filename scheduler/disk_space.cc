#include "scheduler/disk_space.h"

#include <algorithm>
#include <cmath>

#include "scheduler/plan/estimate.h"

namespace voxdag {
namespace {

// Below this resolution a build fits any disk that can hold its scene: no estimate is made.
constexpr uint32_t kMinLevelsToEstimate = 12;
// The pilot of this estimate is so much coarser than the build that it costs next to nothing.
constexpr uint32_t kPilotLevelsBelow = 5;

}  // namespace

bool check_disk_space(const BuildSpec& spec, const PreparedScene& scene, const WorkFolder& work,
                      MemoryBudget& budget, const BuildContext& context) {
  const uint32_t levels = scene.state.grid.levels;
  if (spec.run.force || levels < kMinLevelsToEstimate) return false;
  const std::string output_folder = parent_directory(spec.run.output);
  const uint64_t free_bytes =
      std::min(context.files.free_space(work.path()), context.files.free_space(output_folder));
  if (max_disk_bytes(scene) < static_cast<double>(free_bytes)) return false;
  const Estimate estimate =
      estimate_build(scene, levels - kPilotLevelsBelow, spec.run.threads, budget, context.cancel);
  check_estimate(estimate, context.files, work.path(), output_folder, context.progress);
  return true;
}

// The artifacts of all subvolumes and a global file of about the same size must fit.
std::string full_disk_advice(std::span<const StoredSubvolume> leaves) {
  double built = 0, planned = 0, bytes = 0;
  for (const StoredSubvolume& subvolume : leaves) {
    (subvolume.state == SubvolumeState::kBuilt ? built : planned) += subvolume.weight;
    bytes += static_cast<double>(subvolume.artifact.bytes);
  }
  std::string needed;
  if (built > 0) {
    const double artifacts = bytes * (1 + planned / built);
    needed = "about " + std::to_string(std::llround((2 * artifacts - bytes) / 1e6)) + " MB of ";
  }
  return "; the job is paused: free " + needed + "disk space and run the same command again";
}

}  // namespace voxdag
