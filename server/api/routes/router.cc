#include "server/api/routes/router.h"

#include <algorithm>

#include "core/base/text.h"
#include "server/api/public_problem.h"

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

void check_query(const Request& request, const QueryNames& allowed) {
  if (allowed == kAnyQuery) return;
  for (const auto& [name, value] : request.target.query)
    if (std::find(allowed.begin(), allowed.end(), name) == allowed.end())
      throw bad_request("unknown query parameter");
}

}  // namespace

std::string Call::query(const std::string& name) const {
  const auto found = request.target.query.find(name);
  return found == request.target.query.end() ? "" : found->second;
}

uint64_t Call::query_integer(const std::string& name, uint64_t default_value, uint64_t min,
                             uint64_t max) const {
  const auto found = request.target.query.find(name);
  if (found == request.target.query.end()) return default_value;
  const auto number = parse_numbers<uint64_t, 1>(found->second, 0);
  if (!number || (*number)[0] < min || (*number)[0] > max)
    throw bad_request("'" + name + "': expected an integer from " + std::to_string(min) + " to " +
                      std::to_string(max));
  return (*number)[0];
}

void Router::add(const std::string& method, const std::string& pattern, Role role, Handler handler,
                 const QueryNames& query) {
  add(
      method, pattern, role,
      [context = context_, handler = std::move(handler)](Call& call) {
        return handler(*context, call);
      },
      query);
}

void Router::add(const std::string& method, const std::string& pattern, Role role,
                 PlainHandler handler, const QueryNames& query) {
  routes_.push_back({method, parse_target(pattern).segments, role, std::move(handler), query});
}

Response Router::route(Request& request, AccessControl& access) const {
  const std::string method = request.method == "HEAD" ? "GET" : request.method;
  std::string allowed;
  Call call{request, {}, {}};
  for (const Route& route : routes_) {
    if (!matches(route.pattern, request.target.segments, call.names)) continue;
    if (route.method == method) {
      call.caller = access.admit(request, route.role);
      check_query(request, route.query);
      return route.handler(call);
    }
    allowed += (allowed.empty() ? "" : ", ") + route.method;
    if (route.method == "GET") allowed += ", HEAD";
  }
  access.admit(request, Role::kNone);
  if (allowed.empty()) throw not_found("no such resource");
  Problem problem(405, "method_not_allowed", "expected one of " + allowed);
  problem.headers.emplace("Allow", allowed);
  throw problem;
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
    throw Problem(415, "unsupported_media_type", "expected Content-Type: application/json");
  const Problem too_large(413, "too_large",
                          "the body is larger than " + std::to_string(max_bytes) + " bytes");
  if (request.content_length.value_or(0) > max_bytes) throw too_large;
  std::string body;
  const BodyEnd end = request.read_body([&](std::string_view piece) {
    body += piece;
    return body.size() <= max_bytes;
  });
  if (end == BodyEnd::kStopped) throw too_large;
  if (end == BodyEnd::kTooSlow) throw Problem(408, "timeout", "the body was sent too slowly");
  if (end == BodyEnd::kBroken) throw bad_request("the connection ended within the body");
  return body;
}

void expect_no_body(const Request& request) {
  if (request.has_body) throw bad_request("expected a request without a body");
}

}  // namespace voxdag::server
