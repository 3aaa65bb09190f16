// Routes requests to handlers and checks the role that each needs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/api/access/access_control.h"
#include "server/api/access/tokens.h"
#include "server/http/message.h"

namespace voxdag::server {

struct Context;

// A request to which access was granted.
struct Call {
  Request& request;
  Caller caller;
  std::vector<std::string> names;  // values of the {...} segments of the pattern

  // The value of a query parameter; "" if it is missing.
  std::string query(const std::string& name) const;
  // The integer in a query parameter. Throws Problem (400) unless it is from min to max.
  uint64_t query_integer(const std::string& name, uint64_t default_value, uint64_t min,
                         uint64_t max) const;
};

// The query parameters that a route accepts. Any other is answered with 400.
using QueryNames = std::vector<std::string>;
inline const QueryNames kAnyQuery = {"*"};

class Router {
 public:
  using Handler = std::function<Response(Context&, Call&)>;
  using PlainHandler = std::function<Response(Call&)>;

  // Of routes that need no Context.
  Router() = default;
  explicit Router(Context& context) : context_(&context) {}

  Context& context() const { return *context_; }

  // `pattern` is like "/api/v1/jobs/{id}/dag". A GET route answers HEAD, too.
  void add(const std::string& method, const std::string& pattern, Role role, Handler handler,
           const QueryNames& query = {});
  void add(const std::string& method, const std::string& pattern, Role role, PlainHandler handler,
           const QueryNames& query = {});
  // Throws Problem: 404, 405 with Allow, and as `access` and the handler do.
  Response route(Request& request, AccessControl& access) const;

 private:
  struct Route {
    std::string method;
    std::vector<std::string> pattern;
    Role role;
    PlainHandler handler;
    QueryNames query;
  };
  Context* const context_ = nullptr;
  std::vector<Route> routes_;
};

// "/NAME" for each file that is compiled in, and `start_page` also as "/".
void add_asset_routes(Router& router, const std::string& start_page);
void add_job_routes(Router& router);
void add_result_routes(Router& router);
// The tiles of the results of jobs.
void add_job_tile_routes(Router& router);
void add_event_routes(Router& router);
void add_scene_routes(Router& router);
void add_system_routes(Router& router);

Response json_response(int status, std::string body);
// 204
Response no_content();
// The body of a request. Throws Problem: 413 if it is larger than `max_bytes`, 415 if its content
// type is not JSON, 400 or 408 if it ends early.
std::string read_json_body(Request& request, uint64_t max_bytes);
// Throws Problem (400) if there is a body.
void expect_no_body(const Request& request);

}  // namespace voxdag::server
