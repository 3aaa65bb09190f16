// run_build() builds a global file from a scene. All builds of the command line and of the service
// start here.
#pragma once

#include "scheduler/spec/build_report.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// Runs or resumes the build in the work folder, and returns its report. Throws Error. The output
// path is created only by the final rename, so it never holds a partial file. The report is also
// written to report_path(), unless this path is "".
BuildReport run_build(const BuildSpec& spec, const BuildContext& context);

}  // namespace voxdag
