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

TEST(JobBounds, TheRatesOfManyStagesAreBounded) {
  LiveJob live(0);
  for (uint64_t stage = 0; stage < 200; ++stage) {
    live.apply(StageBegun{"stage " + std::to_string(stage), "units", 1000});
    for (uint64_t i = 1; i <= 1000; ++i) live.apply(StageAdvanced{i, 1000});
    live.apply(StageEnded{});
  }
  const auto rates = nlohmann::json::parse(live.rates_json());
  EXPECT_EQ(rates["stages"].size(), 64u);
  EXPECT_EQ(rates["stages"].back()["name"], "stage 199");
  EXPECT_EQ(rates["stages"].back()["points"].back()[1],
            nlohmann::json::parse(live.progress_json())["rate"]);
  EXPECT_LT(live.rates_json().size(), size_t{512} << 10);
}

}  // namespace
}  // namespace voxdag::server
