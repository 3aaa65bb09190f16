#include "server/api/answers/export_json.h"

#include <nlohmann/json.hpp>

#include "core/fields/json_text.h"
#include "server/base/printable_json.h"
#include "server/base/time_text.h"

namespace voxdag::server {
namespace {

nlohmann::ordered_json time_or_null(double unix_s) {
  return unix_s == 0 ? nlohmann::ordered_json() : nlohmann::ordered_json(time_text(unix_s));
}

}  // namespace

std::string export_json(const Export& it, const LiveJob* live) {
  using nlohmann::ordered_json;
  const std::string self = "/api/v1/jobs/" + it.job + "/exports/" + it.id;
  const std::string progress = live ? live->progress_json() : "";
  const bool has_result = it.state == ExportState::kSucceeded;
  ordered_json files = ordered_json::array();
  for (size_t i = 0; has_result && i < it.result.files.size(); ++i) {
    const ExportedFile& file = it.result.files[i];
    files.push_back({{"name", file.name},
                     {"bytes", file.bytes},
                     {"sha256", file.sha256},
                     {"href", self + "/files/" + std::to_string(i)}});
  }
  ordered_json json = {
      {"id", it.id},
      {"job", it.job},
      {"state", name_of(it.state)},
      {"request", try_parse_json<ordered_json>(it.request)},
      {"created_at", time_or_null(it.created_s)},
      {"started_at", time_or_null(it.started_s)},
      {"finished_at", time_or_null(it.finished_s)},
      {"progress", progress.empty() ? ordered_json() : parse_json<ordered_json>(progress)},
      {"error", it.error_code.empty()
                    ? ordered_json()
                    : ordered_json{{"code", it.error_code}, {"message", it.error_message}}},
      {"voxels", has_result ? ordered_json(it.result.voxels) : ordered_json()},
      {"notes", has_result ? it.result.notes : std::vector<std::string>()},
      {"warnings", has_result ? it.result.warnings : std::vector<std::string>()},
      {"files", std::move(files)},
      {"links", {{"self", self}}}};
  make_printable(json);
  return json_text(json);
}

}  // namespace voxdag::server
