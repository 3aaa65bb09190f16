// run_build(): scene in, global file out. The one entry for the command line and the service.
#pragma once

#include "scheduler/spec/build_report.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Builds, or resumes the build that the work folder holds, or throws Error. Nothing is left under
// the final name unless it is whole. The report is also written to output + ".report.json".
BuildReport run_build(const BuildSpec& spec, const BuildContext& context);

}  // namespace voxdag
