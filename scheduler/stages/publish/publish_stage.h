// The publish stage: completes the partial global file, renames it to the output path, and writes
// the report.
//
// Resume rule: the job store records the file's SHA-256 before the rename. A later run verifies the
// output by this digest and does not write it again. The job store of a short build is lost if the
// build is killed. A later run then builds the output again. It is allowed to replace the existing
// output, because the report of the killed build describes this output
// (scheduler/replaced_result.h). That report was written as "<report>.partial" before the rename.
#pragma once

#include <functional>
#include <string>

#include "core/format/global/global_writer.h"
#include "scheduler/stages/attributes/attribute_sections.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// True if an earlier run published the output file, and the file and the inputs of its attribute
// sections are unchanged. If it returns true, it also fills in the report.
bool is_published(BuildJob& job, AttributeSections& attributes);

// Writes checksums, syncs the file and fills in the job's report. Then calls report_text() and
// writes the returned text to the file of the report, unless the options name no report. Renames
// both files and syncs their folders.
void publish(BuildJob& job, GlobalFileWriter& out, AttributeSections& attributes,
             const std::function<std::string()>& report_text);

}  // namespace voxdag
