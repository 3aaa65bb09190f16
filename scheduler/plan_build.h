// plan_build(): what a build will need, without building. The one entry of `voxdag plan`.
#pragma once

#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/plan/estimate.h"

namespace voxdag {

// Reads the scene, plans its subvolumes and estimates their build.
Estimate plan_build(const BuildSpec& spec, const BuildContext& context);

}  // namespace voxdag
