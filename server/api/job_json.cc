#include "server/api/job_json.h"

#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>

namespace voxdag::server {
namespace {

std::string quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string time_member(double unix_s) {
  return unix_s == 0 ? "null" : '"' + time_text(unix_s) + '"';
}

std::string error_member(const std::optional<JobError>& error) {
  if (!error) return "null";
  return "{\"code\":" + quoted(error->code) + ",\"message\":" + quoted(error->message) +
         ",\"at\":" + time_member(error->at_s) +
         ",\"transient\":" + (error->transient ? "true" : "false") + "}";
}

std::string links(const std::string& self) {
  std::string text = "{\"self\":\"" + self + '"';
  for (const char* name : {"events", "log", "subvolumes", "dag", "report"})
    text += ",\"" + std::string(name) + "\":\"" + self + '/' + name + '"';
  return text + ",\"preview\":\"" + self + "/preview.png\"}";
}

// `json` is JSON text already.
std::string or_null(const std::string& json) { return json.empty() ? "null" : json; }

}  // namespace

std::string time_text(double unix_s) {
  if (unix_s == 0) return "";
  const auto milliseconds = static_cast<int64_t>(std::floor(unix_s * 1000));
  const time_t seconds = milliseconds / 1000;
  tm parts{};
  gmtime_r(&seconds, &parts);
  char text[64];
  const size_t size = strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &parts);
  std::snprintf(text + size, sizeof text - size, ".%03dZ", static_cast<int>(milliseconds % 1000));
  return text;
}

std::string job_json(const Job& job, const LiveJob* live, uint64_t position,
                     unsigned max_attempts) {
  const std::string progress = live ? live->progress_json() : "";
  const std::vector<std::string> warnings = live ? live->warnings() : job.warnings;
  // The request is an object with the members scene, resolution and options: drop its braces.
  const std::string request = job.request.substr(1, job.request.size() - 2);
  return "{\"id\":\"" + job.id + "\",\"name\":" + quoted(job.name) + ",\"state\":\"" +
         state_name(job.state) + "\"," + request + ",\"priority\":" + std::to_string(job.priority) +
         ",\"attempts\":" + std::to_string(job.attempts) +
         ",\"max_attempts\":" + std::to_string(max_attempts) +
         ",\"created_at\":" + time_member(job.created_s) +
         ",\"started_at\":" + time_member(job.started_s) +
         ",\"finished_at\":" + time_member(job.finished_s) +
         ",\"not_before\":" + time_member(job.not_before_s) +
         ",\"position\":" + (position == 0 ? "null" : std::to_string(position)) +
         ",\"progress\":" + or_null(progress.empty() ? job.progress : progress) +
         ",\"result\":" + or_null(job.result) + ",\"error\":" + error_member(job.error) +
         ",\"warnings\":" +
         nlohmann::json(warnings).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) +
         ",\"preview\":" + (job.preview == Preview::kReady ? "true" : "false") +
         ",\"links\":" + links("/api/v1/jobs/" + job.id) + "}";
}

}  // namespace voxdag::server
