#include "server/base/log.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace voxdag::server {
namespace {

constexpr double kTimeS = 1'763'708'400.25;  // 2025-11-21T07:00:00.250Z

TEST(Log, IsTextOrJson) {
  const LogEntry entry{"job 6b1f0c7a93d2e845 failed: io", LogLevel::kError, "6b1f0c7a93d2e845"};
  EXPECT_EQ(log_line(LogFormat::kText, entry, kTimeS),
            "2025-11-21T07:00:00Z job 6b1f0c7a93d2e845 failed: io");
  EXPECT_EQ(log_line(LogFormat::kJson, entry, kTimeS),
            R"({"time":"2025-11-21T07:00:00.250Z","level":"error",)"
            R"("message":"job 6b1f0c7a93d2e845 failed: io","job":"6b1f0c7a93d2e845"})");
  EXPECT_EQ(log_line(LogFormat::kJson, "stopped", kTimeS),
            R"({"time":"2025-11-21T07:00:00.250Z","level":"info","message":"stopped"})");
}

TEST(Log, DescribesRequests) {
  LogEntry entry("audit POST /api/v1/jobs");
  entry.request = LoggedRequest{"1f", "POST", "/api/v1/jobs", 202, "ci", "127.0.0.1", 0.5};
  const auto json = nlohmann::json::parse(log_line(LogFormat::kJson, entry, kTimeS));
  EXPECT_EQ(json["request"], nlohmann::json({{"id", "1f"},
                                             {"method", "POST"},
                                             {"path", "/api/v1/jobs"},
                                             {"status", 202},
                                             {"who", "ci"},
                                             {"from", "127.0.0.1"},
                                             {"duration_s", 0.5}}));
}

// Text of clients and scenes can neither end a line nor make it long.
TEST(Log, IsPrintableAndBounded) {
  LogEntry hostile("a\n\x1b[2J\xff \u202e\"");
  hostile.request = LoggedRequest{"1", "GET\r\n", "/", 200, std::string(1000, 'w'), "\x00", 0};
  const LogEntry shown = printable_entry(hostile);
  EXPECT_EQ(shown.message, "a??[2J? ?\"");
  EXPECT_EQ(shown.request->method, "GET??");
  EXPECT_EQ(shown.request->who, std::string(256, 'w') + "...");
  for (const LogFormat format : {LogFormat::kText, LogFormat::kJson}) {
    const std::string line = log_line(format, shown, kTimeS);
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  }
  EXPECT_EQ(nlohmann::json::parse(log_line(LogFormat::kJson, shown, kTimeS))["message"],
            shown.message);

  std::string text = "x";
  while (text.size() < 20000) text += "\u00e9";
  const std::string message = printable_entry(text).message;
  EXPECT_LE(message.size(), 8192u + 3);
  EXPECT_GE(message.size(), 8191u);
  EXPECT_TRUE(message.ends_with("\u00e9...")) << message.substr(8180);
  EXPECT_TRUE(nlohmann::json::parse(log_line(LogFormat::kJson, message, kTimeS)).is_object());
}

// A cut is always marked, also if the printable text is much shorter than the text.
TEST(Log, MarksCuts) {
  std::string controls;
  for (int i = 0; i < 3000; ++i) controls += "\u202e";
  const std::string message = printable_entry(controls + "the end").message;
  EXPECT_EQ(message, std::string(8192 / 3, '?') + "...");
  EXPECT_EQ(printable_entry(std::string(9000, '\x80')).message, std::string(8189, '?') + "...");
  EXPECT_EQ(printable_entry(std::string(8192, 'x')).message, std::string(8192, 'x'));
  EXPECT_EQ(printable_entry(std::string(8193, 'x')).message, std::string(8192, 'x') + "...");
}

}  // namespace
}  // namespace voxdag::server
