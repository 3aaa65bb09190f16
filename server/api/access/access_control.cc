#include "server/api/access/access_control.h"

#include <algorithm>

#include "core/base/clock.h"
#include "scene/messages.h"
#include "server/http/connection/connection_table.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

// Rate at which one client may send requests with a wrong token. This limits the load from clients
// that guess tokens. Secrecy does not depend on this limit: a 256-bit token cannot be guessed at
// any rate.
constexpr double kWrongTokensPerSecond = 5;

std::string without_port(const std::string& host) {
  const size_t bracket = host.rfind(']');
  const size_t colon = host.rfind(':');
  if (colon == std::string::npos || (bracket != std::string::npos && colon < bracket)) return host;
  return host.substr(0, colon);
}

bool is_write(const std::string& method) { return method != "GET" && method != "HEAD"; }

Problem too_many(const std::string& detail) {
  Problem problem(429, "too_many_requests", detail);
  problem.headers.emplace("Retry-After", "1");
  return problem;
}

Problem unauthorized(const std::string& detail) {
  Problem problem(401, "unauthorized", detail);
  problem.headers.emplace("WWW-Authenticate", "Bearer realm=\"voxdag\"");
  return problem;
}

}  // namespace

AccessControl::AccessControl(const ServerConfig& config, FileSystem& files)
    : hosts_(config.hosts),
      cross_origin_(config.cors_origins),
      requests_(config.transfers.max_requests_per_s),
      wrong_tokens_(kWrongTokensPerSecond) {
  if (!config.token_file.empty()) tokens_ = Tokens::read(files, config.token_file);
  hosts_.insert(hosts_.end(), {"localhost", "127.0.0.1", "[::1]", config.http.address});
}

// Without tokens, only clients on the loopback have access. But any web page in a browser on this
// machine can send requests to the loopback, under the page's own host name (DNS rebinding) or as
// cross-site requests. This function refuses such requests.
void AccessControl::check_site(const Request& request) const {
  const auto is_ours = [&](const std::string& host) {
    return std::any_of(hosts_.begin(), hosts_.end(),
                       [&](const std::string& name) { return equal_ignoring_case(name, host); });
  };
  const std::string host = request.header("Host");
  if (!host.empty() && !is_ours(without_port(host)))
    throw Problem(403, "forbidden",
                  "the Host header '" + printable(host) +
                      "' does not name this service: expected its address or one of hosts in the "
                      "configuration");
  if (cross_origin_.allows(request)) return;
  // A browser hides the answer to a cross-site request from the page. But the page could still
  // waste the service's time, and could infer existing names from response times.
  const auto& segments = request.target.segments;
  if (!segments.empty() && segments[0] == "api" && request.header("Sec-Fetch-Site") == "cross-site")
    throw Problem(
        403, "forbidden",
        "Sec-Fetch-Site is cross-site: expected a request of one of this service's pages");
  if (!is_write(request.method)) return;
  const std::string origin = request.header("Origin");
  const size_t scheme = origin.find("://");
  const bool foreign =
      !origin.empty() && (scheme == std::string::npos || origin.substr(scheme + 3) != host);
  if (foreign)
    throw Problem(403, "forbidden",
                  "cross-site request: the Origin is '" + printable(origin) +
                      "': expected a page of this service, whose Host is '" + printable(host) +
                      "'");
}

Caller AccessControl::identify(const Request& request) {
  const std::string header = request.header("Authorization");
  constexpr std::string_view kScheme = "bearer ";
  if (header.empty()) return {};
  const bool is_bearer =
      header.size() > kScheme.size() &&
      equal_ignoring_case(std::string_view(header).substr(0, kScheme.size()), kScheme);
  if (is_bearer) {
    const auto caller = tokens_->find(trimmed(std::string_view(header).substr(kScheme.size())));
    if (caller) return *caller;
  }
  if (!wrong_tokens_.take(client_of(request.peer), wall_seconds()))
    throw too_many("too many wrong tokens from this client: expected at most 5 per second");
  throw unauthorized(is_bearer
                         ? "unknown token: expected a token of this service"
                         : "the Authorization header has another scheme: expected Bearer TOKEN");
}

Caller AccessControl::admit(Request& request, Role needed) {
  if (!is_loopback(request.peer) && !requests_.take(client_of(request.peer), wall_seconds()))
    throw too_many(
        "too many requests from this client: expected at most transfers.max_requests_per_s of the "
        "configuration per second");
  if (!tokens_) {
    check_site(request);
    request.caller = "local";
    return {Role::kAdmin, request.caller, client_of(request.peer)};
  }
  if (needed == Role::kNone) return {};
  Caller caller = identify(request);
  caller.client = "token " + caller.name;
  request.caller = caller.name;
  if (caller.role == Role::kNone)
    throw unauthorized("no token was given: expected Authorization: Bearer TOKEN");
  if (caller.role < needed)
    throw Problem(403, "forbidden",
                  std::string("the role of the token is ") + role_name(caller.role) +
                      ": expected at least " + role_name(needed));
  return caller;
}

}  // namespace voxdag::server
