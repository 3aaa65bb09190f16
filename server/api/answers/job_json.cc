#include "server/api/answers/job_json.h"

#include <nlohmann/json.hpp>

#include "core/fields/json_text.h"
#include "server/base/printable_json.h"
#include "server/base/time_text.h"
#include "server/base/warning_json.h"

namespace voxdag::server {
namespace {

// Converts a text to a JSON string, or a list of warnings to a JSON array. All texts in the result
// are printable.
template <class T>
std::string as_json(const T& value) {
  nlohmann::json json(value);
  make_printable(json);
  return json_text(json);
}

std::string time_member(double unix_s) {
  return unix_s == 0 ? "null" : '"' + time_text(unix_s) + '"';
}

std::string error_member(const std::optional<JobError>& error) {
  if (!error) return "null";
  return "{\"code\":" + as_json(error->code) + ",\"message\":" + as_json(error->message) +
         ",\"at\":" + time_member(error->at_s) +
         ",\"transient\":" + (error->transient ? "true" : "false") + "}";
}

std::string links(const std::string& self) {
  std::string text = "{\"self\":\"" + self + '"';
  for (const char* name : {"events", "log", "subvolumes", "dag", "report"})
    text += ",\"" + std::string(name) + "\":\"" + self + '/' + name + '"';
  return text + ",\"preview\":\"" + self + "/preview.png\"}";
}

// Returns the members "scene", "resolution", "options" and "labels" of a stored request as JSON
// text without braces. If the stored request is damaged, missing members are empty or 0. Leaves out
// all other members.
std::string request_members(const std::string& request) {
  using nlohmann::ordered_json;
  const auto stored = try_parse_json<ordered_json>(request);
  ordered_json members = {{"scene", ordered_json::array()},
                          {"resolution", 0},
                          {"options", ordered_json::object()},
                          {"labels", ordered_json::array()}};
  for (const auto& [name, value] : members.items())
    if (stored.contains(name)) value = stored[name];
  make_printable(members);
  const std::string text = json_text(members);
  return text.substr(1, text.size() - 2);
}

// Returns `json` with printable texts, or "null" if `json` is "".
std::string or_null(const std::string& json) {
  return json.empty() ? "null" : printable_json_text(json);
}

}  // namespace

std::string job_json(const Job& job, const LiveJob* live, uint64_t position, unsigned max_attempts,
                     const std::string& webhook) {
  const std::string progress = live ? live->progress_json() : "";
  return "{\"id\":\"" + job.id + "\",\"name\":" + as_json(job.name) + ",\"state\":\"" +
         state_name(job.state) + "\"," + request_members(job.request) +
         ",\"priority\":" + std::to_string(job.priority) +
         ",\"attempts\":" + std::to_string(job.attempts) +
         ",\"max_attempts\":" + std::to_string(max_attempts) +
         ",\"created_at\":" + time_member(job.created_s) +
         ",\"started_at\":" + time_member(job.started_s) +
         ",\"finished_at\":" + time_member(job.finished_s) +
         ",\"not_before\":" + time_member(job.not_before_s) +
         ",\"position\":" + (position == 0 ? "null" : std::to_string(position)) +
         ",\"progress\":" + or_null(progress.empty() ? job.progress : progress) +
         ",\"result\":" + or_null(job.result) + ",\"error\":" + error_member(job.error) +
         ",\"warnings\":" + as_json(live ? live->warnings() : job.warnings) +
         ",\"webhook\":" + webhook +
         ",\"preview\":" + (job.preview == Preview::kReady ? "true" : "false") +
         ",\"links\":" + links("/api/v1/jobs/" + job.id) + "}";
}

}  // namespace voxdag::server
