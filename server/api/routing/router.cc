#include "server/api/routing/router.h"

#include <algorithm>

#include "core/base/text.h"
#include "core/fields/field.h"
#include "scene/messages.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

bool is_wildcard(const std::string& part) { return part.starts_with('{'); }

bool matches(const std::vector<std::string>& pattern, const std::vector<std::string>& segments,
             std::vector<std::string>& names) {
  if (pattern.size() != segments.size()) return false;
  names.clear();
  for (size_t i = 0; i < pattern.size(); ++i) {
    if (is_wildcard(pattern[i]))
      names.push_back(segments[i]);
    else if (pattern[i] != segments[i])
      return false;
  }
  return true;
}

Problem unknown_parameter(const Route& route, const std::string& name) {
  std::vector<std::string> names;
  for (const Parameter& parameter : route.query) names.push_back(parameter.name);
  return bad_request("unknown query parameter '" + name.substr(0, 64) + "': expected " +
                     (names.empty() ? "none" : joined(names)));
}

void check_query(const Request& request, const Route& route) {
  if (route.accepts_any_query) return;
  for (const auto& [name, value] : request.target.query)
    if (std::ranges::find(route.query, name, &Parameter::name) == route.query.end())
      throw unknown_parameter(route, name);
}

// Returns the method under which the request's route is registered: GET for HEAD.
std::string method_of(const Request& request) {
  return request.method == "HEAD" ? "GET" : request.method;
}

}  // namespace

std::string Call::query(const std::string& name) const {
  const auto found = request.target.query.find(name);
  return found == request.target.query.end() ? "" : found->second;
}

uint64_t Call::query_integer(const Parameter& parameter) const {
  const IntegerRange& range = parameter.integer.value();
  const auto found = request.target.query.find(parameter.name);
  if (found == request.target.query.end()) return range.default_value.value();
  const auto number = parse_numbers<uint64_t, 1>(found->second, 0);
  if (!number || (*number)[0] < range.min || (*number)[0] > range.max)
    throw bad_request("'" + parameter.name + "' is '" + printable(found->second) +
                      "': expected an integer from " + std::to_string(range.min) + " to " +
                      std::to_string(range.max));
  return (*number)[0];
}

void Router::add(Route route, Handler handler) {
  add(std::move(route), [context = context_, handler = std::move(handler)](Call& call) {
    return handler(*context, call);
  });
}

void Router::add(Route route, PlainHandler handler) {
  // Requests that change something write to the disk, which can be full.
  if (route.method != "GET") route.problems.push_back(507);
  auto segments = parse_target(route.pattern).segments;
  entries_.push_back({std::move(route), std::move(segments), std::move(handler)});
}

Response Router::route(Request& request, AccessControl& access) const {
  const std::string method = method_of(request);
  std::string allowed;
  Call call{request, {}, {}};
  for (const Entry& entry : entries_) {
    if (!matches(entry.segments, request.target.segments, call.names)) continue;
    if (entry.route.method == method) {
      call.caller = access.admit(request, entry.route.role);
      check_query(request, entry.route);
      return entry.handler(call);
    }
    allowed += (allowed.empty() ? "" : ", ") + entry.route.method;
    if (entry.route.method == "GET") allowed += ", HEAD";
  }
  access.admit(request, Role::kNone);
  if (allowed.empty())
    throw not_found("no such resource: '" + printable(request.target.path) +
                    "': expected a path of docs/api.md");
  Problem problem(405, "method_not_allowed",
                  "the method is " + request.method + ": expected one of " + allowed);
  problem.headers.emplace("Allow", allowed);
  throw problem;
}

std::vector<Route> Router::routes() const {
  std::vector<Route> routes;
  for (const Entry& entry : entries_) routes.push_back(entry.route);
  return routes;
}

bool Router::is_documented(const Request& request, int status) const {
  const std::string method = method_of(request);
  std::vector<std::string> names;
  for (const auto& [route, segments, handler] : entries_) {
    if (route.method != method || !matches(segments, request.target.segments, names)) continue;
    const auto& answers = route.answers;
    const auto has = [&](const auto& statuses) {
      return std::find(std::begin(statuses), std::end(statuses), status) != std::end(statuses);
    };
    return route.id.empty() || has(kCommonProblems) || has(route.problems) ||
           std::any_of(answers.begin(), answers.end(),
                       [&](const Answer& answer) { return answer.status == status; });
  }
  return true;
}

Response json_response(int status, std::string body) {
  return make_response(status, "application/json", "no-store", std::move(body));
}

Response no_content() {
  Response response;
  response.status = 204;
  return response;
}

std::string read_json_body(Request& request, uint64_t max_bytes) {
  const std::string type = request.header("Content-Type");
  if (!equal_ignoring_case(trimmed(std::string_view(type).substr(0, type.find(';'))),
                           "application/json"))
    throw Problem(415, "unsupported_media_type",
                  "Content-Type is '" + printable(type) + "': expected application/json");
  const Problem too_large(413, "too_large",
                          "the body is too large: expected at most " + exact_size_text(max_bytes));
  if (request.content_length.value_or(0) > max_bytes) throw too_large;
  std::string body;
  const BodyEnd end = request.read_short_body([&](std::string_view piece) {
    body += piece;
    return body.size() <= max_bytes;
  });
  if (end == BodyEnd::kStopped) throw too_large;
  if (end == BodyEnd::kTooSlow)
    throw Problem(408, "timeout",
                  "the body was sent too slowly: expected at least connections.min_bytes_per_s of "
                  "the configuration");
  if (end == BodyEnd::kBroken)
    throw bad_request(
        "the connection ended within the body, or the body's chunks are malformed: expected "
        "a complete body");
  return body;
}

void expect_no_body(const Request& request) {
  if (request.has_body) throw bad_request("the request has a body: expected none");
}

}  // namespace voxdag::server
