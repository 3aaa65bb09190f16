// plan_build() estimates the time, memory and disk of a build without building. It implements
// `voxdag plan`.
#pragma once

#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/plan/estimate.h"

namespace voxdag {

// Reads the scene, plans its subvolumes and estimates their build.
Estimate plan_build(const BuildSpec& spec, const BuildContext& context);

}  // namespace voxdag
