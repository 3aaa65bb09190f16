#include "server/base/log.h"

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/field.h"
#include "core/fields/json_text.h"
#include "server/base/time_text.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxMessageBytes = 8192;
constexpr size_t kMaxWordBytes = 256;
constexpr size_t kMaxContinuationBytes = 3;  // of a character in UTF-8

// Returns the text on one printable line. If it is longer than `most` bytes, cuts it between two
// characters and appends "...".
std::string bounded(std::string_view text, size_t most) {
  if (text.size() <= most) return printable_line(text);
  const size_t least = most - kMaxContinuationBytes;
  size_t end = most;
  while (end > least && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return printable_line(text.substr(0, end)) + "...";
}

std::string json_line(const LogEntry& entry, double unix_s) {
  nlohmann::ordered_json json = {
      {"time", time_text(unix_s)}, {"level", name_of(entry.level)}, {"message", entry.message}};
  if (!entry.job.empty()) json["job"] = entry.job;
  if (entry.request) {
    const LoggedRequest& r = *entry.request;
    json["request"] = {{"id", r.id},
                       {"method", r.method},
                       {"path", r.path},
                       {"status", r.status},
                       {"who", r.who},
                       {"from", r.from},
                       {"duration_s", r.duration_s}};
  }
  return json_text(json);
}

}  // namespace

LogEntry printable_entry(LogEntry entry) {
  entry.message = bounded(entry.message, kMaxMessageBytes);
  entry.job = bounded(entry.job, kMaxWordBytes);
  if (!entry.request) return entry;
  LoggedRequest& r = *entry.request;
  for (std::string* const word : {&r.id, &r.method, &r.path, &r.who, &r.from})
    *word = bounded(*word, kMaxWordBytes);
  return entry;
}

std::string log_line(LogFormat format, const LogEntry& entry, double unix_s) {
  if (format == LogFormat::kJson) return json_line(entry, unix_s);
  return utc_text(static_cast<int64_t>(unix_s), "%Y-%m-%dT%H:%M:%SZ") + " " + entry.message;
}

}  // namespace voxdag::server
