// Converts an export to JSON (EXPORT in docs/api.md).
#pragma once

#include <string>

#include "server/jobs/live_job.h"
#include "server/jobs/protocol/export_record.h"

namespace voxdag::server {

// Returns the export as JSON. `live` is null unless the process of the export is running.
std::string export_json(const Export& it, const LiveJob* live);

}  // namespace voxdag::server
