#include "scheduler/spec/build_report.h"

#include "core/fields/json_fields.h"
#include "scheduler/spec/report_fields.h"

namespace voxdag {

std::string report_json(const BuildReport& report) {
  // Paths may not be UTF-8, but JSON must be.
  return record_json(report).dump(2, ' ', false, FieldJson::error_handler_t::replace);
}

BuildReport decode_report(const std::string& text) {
  return record_from_text<BuildReport>(text, "the report of a build");
}

}  // namespace voxdag
