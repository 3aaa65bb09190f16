// Which handler a request goes to, and what role that takes.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/api/access/access_control.h"
#include "server/api/access/tokens.h"
#include "server/http/message.h"

namespace voxdag::server {

// A request that was let in.
struct Call {
  Request& request;
  Caller caller;
  std::vector<std::string> names;  // what stands for the {…} of the pattern

  // A query parameter; "" if it is not given.
  std::string query(const std::string& name) const;
  // A whole number in a query parameter. Throws Problem (400) unless it is in range.
  uint64_t query_count(const std::string& name, uint64_t standard, uint64_t least,
                       uint64_t most) const;
  // Throws Problem (400) for a query parameter that is not among these.
  void allow_query(const std::vector<std::string>& names) const;
};

class Router {
 public:
  using Handler = std::function<Response(Call&)>;

  // `pattern` like "/api/v1/jobs/{id}/dag". HEAD is answered where GET is.
  void add(const std::string& method, const std::string& pattern, Role role, Handler handler);
  // Throws Problem: 404, 405 with Allow, what the gate throws, and what the handler throws.
  Response route(Request& request, AccessControl& gate) const;

 private:
  struct Route {
    std::string method;
    std::vector<std::string> pattern;
    Role role;
    Handler handler;
  };
  std::vector<Route> routes_;
};

// An answer of JSON.
Response json_response(int status, std::string body);
// The body of a request, at most so large. Throws Problem: 413, 415 unless it says that it is JSON,
// 400 or 408 if it breaks off.
std::string read_json_body(Request& request, uint64_t max_bytes);
// Throws Problem (400) if there is a body.
void expect_no_body(const Request& request);

}  // namespace voxdag::server
