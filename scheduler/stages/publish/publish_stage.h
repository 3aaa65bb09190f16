// The publish stage: completes the partial global file and renames it to the output path.
//
// Resume rule: the job store records the file's SHA-256 before the rename. A later run verifies the
// output by this digest and does not write it again.
#pragma once

#include "core/format/global/global_writer.h"
#include "scheduler/stages/attributes/attribute_sections.h"
#include "scheduler/state/job/build_job.h"

namespace voxdag {

// True if an earlier run published the output file, and the file and the inputs of its attribute
// sections are unchanged. If it returns true, it also fills in the report.
bool is_published(BuildJob& job, AttributeSections& attributes);

// Writes checksums, syncs and renames the file, and fills in the report.
void publish(BuildJob& job, GlobalFileWriter& out, AttributeSections& attributes);

}  // namespace voxdag
