// Tests requests from web pages of other origins (CORS and frames), labels and the search for jobs,
// and the facts about the machine.
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

constexpr const char* kLab = "https://lab.example.org";

using WebPages = RunningService;

client::HeaderMap cross_site(const std::string& origin) {
  return {{"Origin", origin}, {"Sec-Fetch-Site", "cross-site"}};
}

// Pages of a listed origin may send GET and POST requests, and preflight requests for other
// methods. Pages of other origins may not.
TEST_F(WebPages, AllowsOnlyListedOriginsToUseTheApi) {
  config_.cors_origins = {kLab};
  start();
  const ClientResponse list = http_->get("/api/v1/jobs", cross_site(kLab));
  EXPECT_EQ(list.status, 200);
  EXPECT_EQ(list.header("Access-Control-Allow-Origin"), kLab);
  EXPECT_EQ(list.header("Vary"), "Origin");
  client::HeaderMap asks = cross_site(kLab);
  asks.emplace("Access-Control-Request-Method", "DELETE");
  const ClientResponse preflight = http_->send("OPTIONS", "/api/v1/jobs/x", "", asks);
  EXPECT_EQ(preflight.status, 204);
  EXPECT_NE(preflight.header("Access-Control-Allow-Methods").find("DELETE"), std::string::npos);
  EXPECT_NE(preflight.header("Access-Control-Allow-Headers").find("Authorization"),
            std::string::npos);
  EXPECT_EQ(post("/api/v1/jobs", {{"scene", "none.glb"}, {"resolution", 64}}, cross_site(kLab))
                .header("Access-Control-Allow-Origin"),
            kLab)
      << "pages can read errors, too";
  for (const char* other : {"https://lab.example.org.evil.net", "http://lab.example.org", "null"}) {
    const ClientResponse refused = http_->get("/api/v1/jobs", cross_site(other));
    EXPECT_EQ(not_problem(refused, 403, "forbidden"), "") << other;
    EXPECT_EQ(refused.header("Access-Control-Allow-Origin"), "") << other;
  }
}

TEST_F(WebPages, AllowsNoOtherOriginsByDefault) {
  start();
  client::HeaderMap asks = cross_site(kLab);
  asks.emplace("Access-Control-Request-Method", "GET");
  EXPECT_EQ(http_->send("OPTIONS", "/api/v1/jobs", "", asks).status, 403);
  EXPECT_EQ(http_->get("/api/v1/jobs", cross_site(kLab)).status, 403);
}

// Only the viewer may be shown in a frame, only with "embed" in its URL, and only by pages of the
// origins in the setting.
TEST_F(WebPages, ShowsOnlyTheEmbeddedViewerInFrames) {
  config_.embed_origins = {kLab, "http://localhost:8888"};
  start();
  const auto policy = [&](const std::string& path) {
    const std::string text = http_->get(path).header("Content-Security-Policy");
    return text.substr(text.find("frame-ancestors"));
  };
  EXPECT_EQ(policy("/viewer.html?job=1&embed"),
            "frame-ancestors https://lab.example.org http://localhost:8888");
  for (const char* path : {"/viewer.html?job=1", "/?embed", "/index.html?embed"})
    EXPECT_EQ(policy(path), "frame-ancestors 'none'") << path;
}

TEST_F(WebPages, RefusesOriginsThatAreNone) {
  for (const char* origin : {"*", "lab.example.org", "https://", "https://a.org/path",
                             "https://a b", "https://a.org\r\nX: y"}) {
    config_.cors_origins = {origin};
    EXPECT_THROW(start(), Error) << origin;
  }
}

// The labels of a request are returned with the job. Lists of jobs can be searched by words and by
// label.
TEST_F(WebPages, FindsJobsByWordsAndLabels) {
  start();
  ASSERT_EQ(put_scene("Menger.glb", scene_bytes()).status, 201);
  Json body = {{"scene", "Menger.glb"}, {"resolution", 64}, {"name", "two"}};
  const std::string second = post_job(body);
  body["name"] = "one 100%";
  body["labels"] = {"Night run", "x"};
  const std::string first = post_job(body);
  EXPECT_EQ(job(first)["labels"], Json({"Night run", "x"}));
  EXPECT_EQ(job(second)["labels"], Json::array());
  const auto found = [&](const std::string& query) {
    std::string ids;
    const Json list = Json::parse(http_->get("/api/v1/jobs?" + query).body);
    for (const Json& each : list["jobs"]) ids += each["id"] == first ? "1" : "2";
    return ids;
  };
  EXPECT_EQ(found("q=menger"), "12");
  EXPECT_EQ(found("q=ONE"), "1");
  EXPECT_EQ(found("q=night"), "1");
  EXPECT_EQ(found("q=" + second.substr(0, 9)), "2");
  EXPECT_EQ(found("q=100%25"), "1") << "a percent sign is no wildcard";
  EXPECT_EQ(found("q=resolution"), "") << "names of members are not searched";
  EXPECT_EQ(found("label=Night%20run"), "1");
  EXPECT_EQ(found("label=Night"), "");
  EXPECT_EQ(found("q=menger&label=x"), "1");
  EXPECT_EQ(http_->get("/api/v1/jobs?q=" + std::string(401, 'a')).status, 400);
  EXPECT_EQ(http_->get("/api/v1/jobs?q=a%0a").status, 400);
  EXPECT_EQ(
      post("/api/v1/jobs", {{"scene", "Menger.glb"}, {"resolution", 64}, {"labels", {"a\nb"}}})
          .status,
      400);
}

TEST_F(WebPages, DescribesTheMachine) {
  start();
  const Json machine = Json::parse(http_->get("/api/v1/machine").body);
  EXPECT_GE(machine["cores"], 1);
  EXPECT_GT(machine["free_disk_bytes"], 0);
  EXPECT_GT(machine["job_memory_bytes"], 0);
  EXPECT_EQ(machine["running_jobs"], 0);
}

}  // namespace
}  // namespace voxdag::server
