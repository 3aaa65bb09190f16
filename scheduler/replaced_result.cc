#include "scheduler/replaced_result.h"

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/fields/field.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/format/global/open_global.h"
#include "core/io/overwrite.h"
#include "scheduler/check_spec.h"
#include "scheduler/spec/build_report.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

constexpr uint64_t kMaxReplacedReportBytes = uint64_t{1} << 24;

// Returns the report at `path`. Returns nullopt if the report is missing, or if the size of its
// output is not `output_bytes`.
std::optional<BuildReport> report_at(FileSystem& files, const std::string& path,
                                     uint64_t output_bytes) {
  try {
    if (path.empty() || !files.exists(path)) return std::nullopt;
    BuildReport report = decode_report(read_own_file(files, path, kMaxReplacedReportBytes));
    if (report.bytes == output_bytes && !report.scenes.empty()) return report;
  } catch (const Error&) {
    // The file is not a report, or a report of an earlier version.
  }
  return std::nullopt;
}

// Returns the report of the build that wrote the output, or nullopt if it is not found. Looks at
// this build's report path, and then at the default path, which the earlier build can have used. If
// a build was killed after it renamed the output, its report is still in a partial file.
std::optional<BuildReport> report_of_output(FileSystem& files, const RunOptions& run,
                                            uint64_t output_bytes) {
  const std::string given = report_path(run), usual = default_report_path(run.output);
  for (const std::string& path : {given, given.empty() ? "" : given + ".partial", usual})
    if (auto report = report_at(files, path, output_bytes)) return report;
  return std::nullopt;
}

// Returns names as the JSON of a report contains them: bytes that are not UTF-8 become U+FFFD.
std::vector<std::string> as_reported(const std::vector<std::string>& names) {
  std::vector<std::string> out;
  for (const std::string& name : names) out.push_back(as_utf8(name));
  return out;
}

// Refuses the output as refuse_result_of_other_scene() does, but also if the work folder has a job.
void refuse_other_result(FileSystem& files, const BuildSpec& spec) {
  const RunOptions& run = spec.run;
  if (run.force) return;
  const auto file = open_if_there(files, run.output);
  if (!file || file->size() == 0 || !is_global_file(*file)) return;
  const std::vector<std::string> scenes = as_reported(reported_scenes(spec));
  const auto report = report_of_output(files, run, file->size());
  if (report && report->scenes == scenes) return;
  const std::string found =
      report ? "is the result of another scene, " + joined(report->scenes)
             : "exists, and no report shows that " + joined(scenes) + " is its scene";
  const std::string force = option_text("force");
  throw Error(ErrorCode::kInvalidInput, run.output + ": " + found + ", and would be replaced" +
                                            (report ? " by " + joined(scenes) : "") +
                                            ": expected another output" +
                                            (force.empty() ? "" : "; " + force + " replaces it"));
}

}  // namespace

void refuse_result_of_other_scene(FileSystem& files, const BuildSpec& spec) {
  if (!files.exists(WorkFolder::store_path(work_folder_of(spec.run))))
    refuse_other_result(files, spec);
}

void guard_outputs(GuardedOutputs& files, const RunOptions& run) {
  files.guard_output(run.output);
  if (const std::string path = report_path(run); !path.empty()) files.guard_output(path);
}

void check_changed_output(BuildJob& job, GuardedOutputs& files) {
  if (files.is_unchanged()) return;
  refuse_other_result(files, job.spec);
  check_places(job.spec, job.scene, job.context);
  guard_outputs(files, job.spec.run);
}

}  // namespace voxdag
