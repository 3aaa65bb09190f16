// Whether the disk has space for a build: asked before anything is built, and answered again when
// the disk is full.
#pragma once

#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "scheduler/job/job_store.h"
#include "scheduler/job/work_folder.h"
#include "scheduler/prepare.h"

namespace voxdag {

// Throws Error{kNoSpace} for a build that cannot fit, unless it is forced; warns if it may not.
// Returns whether that took an estimate, which runs a pilot build.
bool check_disk_space(const BuildSpec& spec, const PreparedScene& scene, const WorkFolder& work,
                      MemoryBudget& budget, const BuildContext& context);

// What to do about a full disk, as the end of an error message; the space is estimated from the
// subvolumes that are built.
std::string full_disk_advice(std::span<const StoredSubvolume> leaves);

}  // namespace voxdag
