// Whatever a client and a job's process send, the stored job has a bounded size, and its texts are
// printable.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/base/text/printable.h"
#include "server/base/request_error.h"
#include "server/jobs/live_job.h"
#include "server/jobs/protocol/job_request.h"

namespace voxdag::server {
namespace {

// Returns true if the request is refused as invalid.
bool refuses_request(const nlohmann::json& body) {
  try {
    parse_job_request(body.dump());
  } catch (const RequestError& error) {
    return error.kind() == RequestError::Kind::kInvalid;
  }
  return false;
}

TEST(JobBounds, NamesWithControlCharactersAreRefused) {
  for (const char* control :
       {"\n", "\x1b", "\x7f", "\u0085", "\u009b", "\u2028", "\u202e", "\u2066", "\u200f"}) {
    SCOPED_TRACE(testing::PrintToString(std::string(control)));
    const std::string name = std::string("a") + control + "b";
    EXPECT_TRUE(refuses_request({{"scene", "a.glb"}, {"resolution", 64}, {"name", name}}));
    EXPECT_TRUE(refuses_request({{"scene", "/srv/" + name + ".glb"}, {"resolution", 64}}));
    EXPECT_TRUE(refuses_request(
        {{"scene", "a.glb"}, {"resolution", 64}, {"options", {{"columns", "x,y,z" + name}}}}));
  }
  EXPECT_FALSE(
      refuses_request({{"scene", "a.glb"}, {"resolution", 64}, {"name", "Gr\u00fc\u00dfe"}}));
}

TEST(JobBounds, TextsOfTheProcessAreCutAndPrintable) {
  const std::string evil = "\x1b[31m\nforged\xc2\x9b" + std::string(100000, 'x');
  LiveJob live(0);
  live.apply(StageBegun{evil, evil, 1});
  for (int i = 0; i < 200; ++i) live.apply(WarningReported{{evil, evil, evil, 1}});
  live.apply(Failure{evil, evil});
  ClusterTasks tasks;
  for (int i = 0; i < 5000; ++i) tasks.running[std::to_string(i) + evil.substr(0, 200)] = 1;
  live.apply(tasks);
  live.apply(Result{"{\"a\":\"" + std::string(1 << 20, 'x') + "\"}"});
  size_t bytes = 0;
  for (const Warning& warning : live.warnings()) {
    EXPECT_TRUE(is_printable(warning.text()));
    bytes += warning.code.size() + warning.text().size();
  }
  EXPECT_LT(bytes, size_t{48} << 10);
  EXPECT_TRUE(is_printable(live.failure()->text));
  EXPECT_LT(live.failure()->text.size() + live.failure()->code.size(), 5000u);
  EXPECT_TRUE(is_printable(live.progress_json()));
  EXPECT_EQ(live.progress_json().find("\\u001b"), std::string::npos);
  EXPECT_LT(live.progress_json().size(), size_t{96} << 10);
  EXPECT_EQ(live.result(), "");
}

}  // namespace
}  // namespace voxdag::server
