// The entries of the service's log, and their forms as text and as JSON.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <utility>

namespace voxdag::server {

enum class LogLevel { kInfo, kWarning, kError };
constexpr std::array<const char*, 3> enum_names(LogLevel) { return {"info", "warning", "error"}; }

// A request that was answered, in the log.
struct LoggedRequest {
  std::string id;      // the answer's X-Request-Id
  std::string method;  // as the client sent it
  std::string path;    // without its query, percent-encoded
  int status = 0;
  std::string who;   // name of the caller's token, "local", or "-" if the caller is unknown
  std::string from;  // the client's address
  double duration_s = 0;
};

struct LogEntry {
  // The constructors are not explicit, so that callers can pass a message as an entry.
  LogEntry(std::string text, LogLevel entry_level = LogLevel::kInfo, std::string job_id = "")
      : message(std::move(text)), level(entry_level), job(std::move(job_id)) {}
  LogEntry(const char* text) : message(text) {}

  std::string message;
  LogLevel level = LogLevel::kInfo;
  std::string job;  // id of the job that the entry is about; "" if it is about no single job
  std::optional<LoggedRequest> request = {};
};

// Writes an entry to the log.
using Log = std::function<void(const LogEntry& entry)>;

enum class LogFormat { kText, kJson };
constexpr std::array<const char*, 2> enum_names(LogFormat) { return {"text", "json"}; }

// Returns the entry with printable texts of limited length, because they can contain text from
// clients and scenes.
LogEntry printable_entry(LogEntry entry);

// Returns the entry as one line, without a line feed. `unix_s` is the time of the entry.
//   kText: "2026-11-21T07:00:00Z job 6b1f0c7a93d2e845 running"
//   kJson: {"time":"2026-11-21T07:00:00.123Z","level":"info","message":"job ... running","job":...}
std::string log_line(LogFormat format, const LogEntry& entry, double unix_s);

}  // namespace voxdag::server
