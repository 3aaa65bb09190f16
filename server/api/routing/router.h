// Routes requests to handlers and checks each route's required role.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/api/access/access_control.h"
#include "server/api/routing/route.h"

namespace voxdag::server {

struct Context;

class Router {
 public:
  using Handler = std::function<Response(Context&, Call&)>;
  using PlainHandler = std::function<Response(Call&)>;

  // A router for routes that need no Context.
  Router() = default;
  explicit Router(Context& context) : context_(&context) {}

  Context& context() const { return *context_; }

  void add(Route route, Handler handler);
  void add(Route route, PlainHandler handler);
  // Calls the handler of the request's route. Throws Problem: 404 for an unknown path, 405 with the
  // header Allow for a wrong method, 400 for an unknown query parameter. Also throws the problems
  // of `access` and of the handler.
  Response route(Request& request, AccessControl& access) const;

  std::vector<Route> routes() const;
  // Returns false if the request's route is in the OpenAPI document but does not list this status.
  bool is_documented(const Request& request, int status) const;

 private:
  struct Entry {
    Route route;
    std::vector<std::string> segments;  // segments of the pattern
    PlainHandler handler;
  };
  Context* const context_ = nullptr;
  std::vector<Entry> entries_;
};

Response json_response(int status, std::string body);
// Returns a response with the status 204.
Response no_content();
// Reads the body of a request. Throws Problem: 413 if it is larger than `max_bytes`, 415 if its
// content type is not JSON, 400 if the connection ends within it, 408 if it is sent too slowly.
std::string read_json_body(Request& request, uint64_t max_bytes);
// Throws Problem (400) if the request has a body.
void expect_no_body(const Request& request);

}  // namespace voxdag::server
