#include "cli/syntax/resolutions.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::cli {
namespace {

// Returns "folder/name-1024.vdag" for "folder/name.vdag".
std::string with_number(const std::string& path, uint64_t number) {
  const size_t name = path.find_last_of('/') + 1;
  size_t dot = path.find_last_of('.');
  if (dot == std::string::npos || dot <= name) dot = path.size();
  return path.substr(0, dot) + "-" + std::to_string(number) + path.substr(dot);
}

}  // namespace

std::vector<uint64_t> parse_resolutions(const std::string& text) {
  std::vector<uint64_t> resolutions;
  for (size_t at = 0; at <= text.size();) {
    const size_t end = std::min(text.find(',', at), text.size());
    uint64_t resolution = 0;
    if (!parse_text(kResolutionField, text.substr(at, end - at), resolution))
      throw Error(ErrorCode::kInvalidInput, option_name(kResolutionField.name) + ": '" + text +
                                                "': expected " +
                                                expectation<uint64_t>(kResolutionField));
    if (std::ranges::find(resolutions, resolution) != resolutions.end())
      throw Error(ErrorCode::kInvalidInput, option_name(kResolutionField.name) + ": '" + text +
                                                "': expected each resolution once");
    resolutions.push_back(resolution);
    at = end + 1;
  }
  return resolutions;
}

std::string resolutions_help() {
  return documentation(kResolutionField, uint64_t{0}, true) +
         "; with several, such as 1k,2k, OUT.vdag becomes OUT-1024.vdag and OUT-2048.vdag";
}

std::vector<BuildSpec> builds_of(const BuildSpec& spec, const std::vector<uint64_t>& resolutions) {
  if (resolutions.empty()) return {spec};
  std::vector<BuildSpec> builds(resolutions.size(), spec);
  for (size_t i = 0; i < builds.size(); ++i) {
    RunOptions& run = builds[i].run;
    builds[i].geometry.resolution = resolutions[i];
    if (builds.size() == 1) break;
    run.output = with_number(run.output, resolutions[i]);
    if (!run.work_folder.empty()) run.work_folder = with_number(run.work_folder, resolutions[i]);
    if (!run.report.empty() && run.report != "none")
      run.report = with_number(run.report, resolutions[i]);
  }
  return builds;
}

}  // namespace voxdag::cli
