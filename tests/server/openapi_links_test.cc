// Tests of the links in the OpenAPI document.
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

using OpenApiLinks = RunningService;

// Returns the path of an operation of the document with the parameters of a link to it. `expand`
// replaces the expressions of OpenAPI. Adds a failure if a parameter of the path has no value.
template <class Expand>
std::string path_of_link(const Json& api, const Json& link, const Expand& expand) {
  for (const auto& [path, operations] : api.at("paths").items())
    for (const auto& [method, operation] : operations.items()) {
      if (operation.at("operationId") != link.at("operationId")) continue;
      std::string full = path;
      for (const auto& [name, value] : link.at("parameters").items()) {
        const size_t at = full.find('{' + name + '}');
        EXPECT_NE(at, std::string::npos) << path << " has no parameter " << name;
        if (at != std::string::npos) full.replace(at, name.size() + 2, expand(value));
      }
      EXPECT_EQ(full.find('{'), std::string::npos) << full;
      return full;
    }
  ADD_FAILURE() << "no operation " << link;
  return "";
}

// The links of the answers that create a job or an export lead to the other requests of this job or
// export.
TEST_F(OpenApiLinks, LeadFromNewJobsAndExportsToTheirRequests) {
  start();
  put_scene("m.glb", scene_bytes());
  const Json api = Json::parse(http_->get("/openapi.json").body);
  const auto links_of = [&](const std::string& path) {
    return api.at("paths").at(path).at("post").at("responses").at("202").at("links");
  };
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  const Json of_job = links_of("/api/v1/jobs");
  const std::pair<const char*, const char*> requests[] = {
      {"getJob", ""},           {"deleteJob", ""},           {"patchJob", ""},
      {"followJob", "/events"}, {"cancelJob", "/cancel"},    {"getDag", "/dag"},
      {"getReport", "/report"}, {"listExports", "/exports"}, {"postExport", "/exports"}};
  for (const auto& [operation, path] : requests) {
    ASSERT_TRUE(of_job.contains(operation)) << of_job;
    EXPECT_EQ(path_of_link(api, of_job.at(operation),
                           [&](const Json& value) {
                             EXPECT_EQ(value, "$response.body#/id");
                             return id;
                           }),
              "/api/v1/jobs/" + id + path);
  }

  const std::string exports = "/api/v1/jobs/" + id + "/exports";
  const ClientResponse created = post(exports, {{"to", "ply"}});
  ASSERT_EQ(created.status, 202) << created.body;
  const Json of_export = links_of("/api/v1/jobs/{id}/exports");
  EXPECT_EQ(of_export.size(), 3u) << of_export;
  const auto expand = [&](const Json& value) -> std::string {
    if (value == "$request.path.id") return id;
    if (value == "$response.body#/id") return Json::parse(created.body).at("id");
    return value.dump();
  };
  const std::string path = path_of_link(api, of_export.at("getExport"), expand);
  ASSERT_TRUE(until([&] { return Json::parse(http_->get(path).body)["state"] == "succeeded"; }));
  EXPECT_EQ(http_->get(path_of_link(api, of_export.at("getExportFile"), expand)).status, 200);
  EXPECT_EQ(
      http_->send("DELETE", path_of_link(api, of_export.at("deleteExport"), expand), "").status,
      204);
}

}  // namespace
}  // namespace voxdag::server
