#include "scheduler/spec/build_report.h"

#include <filesystem>
#include <system_error>

#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/io/file_system.h"
#include "scheduler/spec/report_fields.h"

namespace voxdag {

std::string report_json(const BuildReport& report) {
  // Replaces invalid UTF-8, which paths can contain but JSON cannot.
  return json_text(record_json(report), 2);
}

std::vector<std::string> reported_scenes(const BuildSpec& spec) {
  namespace fs = std::filesystem;
  std::error_code failure;
  const fs::path folder = fs::absolute(parent_directory(spec.run.output), failure);
  std::vector<std::string> names;
  for (const std::string& scene : spec.geometry.scenes) {
    const fs::path name = fs::exists(scene, failure)
                              ? fs::proximate(fs::absolute(scene, failure), folder, failure)
                              : fs::path(scene);
    names.push_back(failure ? scene : name.string());
  }
  return names;
}

BuildReport decode_report(const std::string& text) {
  return record_from_text<BuildReport>(text, "the report of a build");
}

}  // namespace voxdag
