#pragma once

#include <span>
#include <string>

#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

// Returns advice about a full disk for the end of an error message. The disk needs space for the
// artifacts of all subvolumes, estimated from the built subvolumes, and for a global file of about
// the same size. Colors need additional space. The advice says how the users of this process resume
// the build.
inline std::string full_disk_advice(std::span<const StoredSubvolume> leaves, bool has_colors) {
  double built = 0, planned = 0, bytes = 0;
  for (const StoredSubvolume& subvolume : leaves) {
    (subvolume.state == SubvolumeState::kBuilt ? built : planned) += subvolume.weight;
    bytes += static_cast<double>(subvolume.artifact.bytes);
  }
  std::string needed;
  if (built > 0 && bytes > 0) {
    const double artifacts = bytes * (1 + planned / built);
    needed = "about " + size_text(static_cast<uint64_t>(2 * artifacts - bytes)) + " of ";
    const std::string plan = command_text("plan");
    if (has_colors)
      needed = "the space for colors (" + (plan.empty() ? "a plan" : plan) + " estimates it) and " +
               needed;
  }
  return "; the finished work is kept: free " + needed + "disk space and " + repeat_text();
}

}  // namespace voxdag
