#include "server/api/openapi/document.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace voxdag::server {
namespace {

Route some_route() {
  return {.method = "GET",
          .pattern = "/api/v1/jobs/{id}/weather",
          .id = "getWeather",
          .summary = "The weather during a job",
          .tag = "jobs",
          .query = {{"limit", "maximum number of clouds", "", IntegerRange{1, 20, 5}}},
          .answers = {{200, "clouds", {json_content("Point")}}},
          .problems = {404}};
}

nlohmann::json document_of(const Route& route) {
  Router router;
  router.add(route, [](Call&) { return Response{}; });
  return nlohmann::json::parse(openapi_document(router));
}

TEST(OpenApiDocument, DescribesARoute) {
  const auto all = document_of(some_route());
  const auto& get = all.at("paths").at("/api/v1/jobs/{id}/weather").at("get");
  EXPECT_EQ(get.at("operationId"), "getWeather");
  EXPECT_EQ(get.at("x-role"), "read");
  ASSERT_EQ(get.at("parameters").size(), 2u);
  EXPECT_EQ(get["parameters"][0]["in"], "path");
  EXPECT_EQ(get["parameters"][1]["schema"]["maximum"], 20);
  EXPECT_EQ(get["responses"]["200"]["content"]["application/json"]["schema"]["$ref"],
            "#/components/schemas/Point");
  for (const char* status : {"400", "404", "503"})
    EXPECT_TRUE(get["responses"].contains(status)) << status;
  EXPECT_FALSE(get["responses"].contains("409"));
}

TEST(OpenApiDocument, RefersOnlyToWhatExists) {
  Route route = some_route();
  route.answers[0].contents[0].schema = "Weather";
  EXPECT_THROW(document_of(route), std::logic_error);
  route = some_route();
  route.problems = {418};
  EXPECT_THROW(document_of(route), std::logic_error);
  route = some_route();
  route.pattern = "/api/v1/clouds/{cloud}";
  EXPECT_THROW(document_of(route), std::logic_error);
}

TEST(OpenApiDocument, LacksRoutesWithoutAnId) {
  Route route = some_route();
  route.id = "";
  EXPECT_TRUE(document_of(route).at("paths").empty());
}

TEST(Router, KnowsWhichStatusesARouteDocuments) {
  Router router;
  router.add(some_route(), [](Call&) { return Response{}; });
  Request request;
  request.method = "HEAD";
  request.target = parse_target("/api/v1/jobs/0123456789abcdef/weather");
  for (const int status : {200, 400, 404}) EXPECT_TRUE(router.is_documented(request, status));
  EXPECT_FALSE(router.is_documented(request, 409));
}

}  // namespace
}  // namespace voxdag::server
