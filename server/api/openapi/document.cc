#include "server/api/openapi/document.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "core/base/text.h"
#include "core/fields/json_text.h"
#include "scene/formats/formats.h"
#include "server/api/openapi/schemas.h"
#include "server/http/message/target.h"
#include "server/scenes/scene_store.h"

namespace voxdag::server {
namespace {

// Returns the path parameters of all routes: one for each name of a {...} segment.
std::vector<Parameter> path_parameters() {
  return {
      {"id", "id of the job, 16 hex digits", "^[0-9a-f]{16}$"},
      {"export", "id of the export, 16 hex digits", "^[0-9a-f]{16}$"},
      {"file", "index of the file in `files` of the export", "", IntegerRange{0, 15}},
      {"name", "name of the scene, ending with " + list_scene_endings(), scene_name_pattern()},
      {"level", "level of a node, 0 for the root", "", IntegerRange{0, 17}},
      {"offset", "offset of the node within its level, in words", "",
       IntegerRange{0, (uint64_t{1} << 40) - 1}},
  };
}

constexpr std::pair<int, const char*> kProblems[] = {
    {400, "the request is invalid"},
    {401, "a valid bearer token is required"},
    {403, "the role is not sufficient, or the Host or Origin is wrong"},
    {404, "not found"},
    {408, "the request was sent too slowly"},
    {409, "the job or the export is in another state, or the scene is in use"},
    {410, "the file was replaced: its manifest has a new digest"},
    {413, "the body is too large"},
    {415, "the content type is not JSON, or the body is encoded"},
    {416, "no range is within the file"},
    {422, "the idempotency key belongs to another request, a limit is exceeded, or no GPU exists"},
    {429, "too many requests"},
    {431, "the header fields are too large"},
    {500, "internal error"},
    {503, "the service is busy; see Retry-After"},
    {507, "the disk is full"},
};

Json reference(const std::string& kind, const std::string& name) {
  return {{"$ref", "#/components/" + kind + "/" + name}};
}

Json schema_of(const Parameter& parameter) {
  if (!parameter.integer) {
    Json schema = {{"type", "string"}};
    if (!parameter.pattern.empty()) schema["pattern"] = parameter.pattern;
    return schema;
  }
  const IntegerRange& range = *parameter.integer;
  Json schema = {{"type", "integer"}, {"minimum", range.min}, {"maximum", range.max}};
  if (range.default_value) schema["default"] = *range.default_value;
  return schema;
}

Json schema_of(const Content& content) {
  if (!content.schema.empty()) {
    if (!schemas().contains(content.schema)) throw std::logic_error("no schema " + content.schema);
    return reference("schemas", content.schema);
  }
  if (content.type == "application/json") return {{"type", "object"}};
  if (content.type.starts_with("text/") || content.type.starts_with("multipart/"))
    return {{"type", "string"}};
  return {{"type", "string"}, {"format", "binary"}};
}

Json describe(const Parameter& parameter, const char* place) {
  Json json = {{"name", parameter.name}, {"in", place}};
  if (parameter.is_required) json["required"] = true;
  json["description"] = parameter.description;
  json["schema"] = schema_of(parameter);
  return json;
}

// Returns the names of the {...} segments of the route's pattern.
std::vector<std::string> path_names(const Route& route) {
  std::vector<std::string> names;
  for (const std::string& segment : parse_target(route.pattern).segments)
    if (segment.starts_with('{')) names.push_back(segment.substr(1, segment.size() - 2));
  return names;
}

Json describe_parameters(const Route& route) {
  Json list = Json::array();
  const std::vector<Parameter> known_names = path_parameters();
  for (const std::string& name : path_names(route)) {
    const auto found = std::find_if(known_names.begin(), known_names.end(),
                                    [&](const Parameter& known) { return known.name == name; });
    if (found == known_names.end()) throw std::logic_error("no path parameter " + name);
    Parameter parameter = *found;
    parameter.is_required = true;
    list.push_back(describe(parameter, "path"));
  }
  for (const Parameter& parameter : route.query) list.push_back(describe(parameter, "query"));
  for (const Parameter& parameter : route.headers) list.push_back(describe(parameter, "header"));
  return list;
}

Json describe(const std::vector<Content>& contents) {
  Json json = Json::object();
  for (const Content& content : contents) json[content.type] = {{"schema", schema_of(content)}};
  return json;
}

Json describe(const Answer& answer) {
  Json json = {{"description", answer.description}};
  if (!answer.contents.empty()) json["content"] = describe(answer.contents);
  for (const Parameter& header : answer.headers)
    json["headers"][header.name] = {{"description", header.description},
                                    {"schema", schema_of(header)}};
  return json;
}

using Names = std::vector<std::string>;

// Returns the OpenAPI links of an answer that describes one job. The links lead to all routes whose
// only required parameter is the id of a job.
Json job_links(const std::vector<Route>& routes) {
  Json links = Json::object();
  for (const Route& route : routes)
    if (path_names(route) == Names{"id"} &&
        std::ranges::none_of(route.query, &Parameter::is_required))
      links[route.id] = {{"operationId", route.id}, {"parameters", {{"id", "$response.body#/id"}}}};
  return links;
}

// Returns the OpenAPI links of an answer that describes one export, to all routes of an export. The
// link of a file leads to the first file.
Json export_links(const std::vector<Route>& routes) {
  Json links = Json::object();
  for (const Route& route : routes) {
    const Names names = path_names(route);
    if (names.size() < 2 || names[1] != "export") continue;
    Json parameters = {{"id", "$request.path.id"}, {"export", "$response.body#/id"}};
    if (names.size() == 3) parameters[names[2]] = 0;
    links[route.id] = {{"operationId", route.id}, {"parameters", std::move(parameters)}};
  }
  return links;
}

// Returns the OpenAPI links of an answer. Only the answers to requests that create a job or an
// export have links.
Json links_of(const Route& route, const Answer& answer, const std::vector<Route>& routes) {
  const auto has = [&](const char* schema) {
    return route.method == "POST" &&
           std::ranges::any_of(answer.contents,
                               [&](const Content& content) { return content.schema == schema; });
  };
  if (has("Job") && path_names(route).empty()) return job_links(routes);
  return has("Export") ? export_links(routes) : Json::object();
}

std::set<int> problems_of(const Route& route) {
  std::set<int> statuses(std::begin(kCommonProblems), std::end(kCommonProblems));
  statuses.insert(route.problems.begin(), route.problems.end());
  return statuses;
}

Json describe_answers(const Route& route, const std::vector<Route>& routes) {
  Json answers = Json::object();
  for (const Answer& answer : route.answers) {
    Json& json = answers[std::to_string(answer.status)] = describe(answer);
    if (Json links = links_of(route, answer, routes); !links.empty())
      json["links"] = std::move(links);
  }
  for (const int status : problems_of(route))
    answers[std::to_string(status)] = reference("responses", "E" + std::to_string(status));
  return answers;
}

Json describe(const Route& route, const std::vector<Route>& routes) {
  Json json = {{"operationId", route.id},
               {"summary", route.summary},
               {"x-role", role_name(route.role)},
               {"tags", {route.tag}}};
  if (Json parameters = describe_parameters(route); !parameters.empty())
    json["parameters"] = std::move(parameters);
  if (route.body)
    json["requestBody"] = {{"required", route.is_body_required},
                           {"content", describe(std::vector<Content>{*route.body})}};
  json["responses"] = describe_answers(route, routes);
  if (route.role == Role::kNone) json["security"] = Json::array();
  return json;
}

Json describe_problems() {
  Json json;
  for (const auto& [status, description] : kProblems)
    json["E" + std::to_string(status)] = {
        {"description", description},
        {"content", {{"application/problem+json", {{"schema", reference("schemas", "Problem")}}}}}};
  return json;
}

}  // namespace

std::string openapi_document(const Router& router) {
  std::vector<Route> routes = router.routes();
  std::erase_if(routes, [](const Route& route) { return route.id.empty(); });
  Json paths = Json::object(), tags = Json::array();
  const Json problems = describe_problems();
  for (const Route& route : routes) {
    for (const int status : problems_of(route))
      if (!problems.contains("E" + std::to_string(status)))
        throw std::logic_error("no description of status " + std::to_string(status));
    std::string method = route.method;
    for (char& c : method) c = static_cast<char>(std::tolower(c));
    paths[route.pattern][method] = describe(route, routes);
    const Json tag = {{"name", route.tag}};
    if (std::find(tags.begin(), tags.end(), tag) == tags.end()) tags.push_back(tag);
  }
  const Json document = {
      {"openapi", "3.1.0"},
      {"info",
       {{"title", "voxdag"},
        {"version", "1"},
        {"summary", "Builds sparse voxel DAGs from triangle scenes"},
        {"description", "See docs/api.md."},
        {"license", {{"name", "See LICENSE"}}}}},
      {"servers", {{{"url", "/"}}}},
      {"security", {Json::object(), {{"bearer", Json::array()}}}},
      {"tags", tags},
      {"paths", paths},
      {"components",
       {{"securitySchemes", {{"bearer", {{"type", "http"}, {"scheme", "bearer"}}}}},
        {"responses", problems},
        {"schemas", schemas()}}}};
  return exact_json_text(document);
}

}  // namespace voxdag::server
