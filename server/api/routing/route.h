// One row of the router's table: the form of a request, the role that it requires, and its answers.
// The router checks requests against the rows. The OpenAPI document is generated from the rows.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/api/access/tokens.h"
#include "server/http/message/message.h"

namespace voxdag::server {

struct IntegerRange {
  uint64_t min = 0, max = 0;
  std::optional<uint64_t> default_value = {};
};

// A query parameter, or a header field of a request or of an answer.
struct Parameter {
  std::string name;
  std::string description;
  std::string pattern = {};  // regular expression for the value; "" for any text
  std::optional<IntegerRange> integer = {};
  bool is_required = false;
};

// A request's body, or one possible body of an answer.
struct Content {
  std::string type;         // media type
  std::string schema = {};  // name of a schema in openapi/schemas.h; "" for bytes, text or any JSON
};

struct Answer {
  int status;
  std::string description;
  std::vector<Content> contents = {};  // empty: no body
  std::vector<Parameter> headers = {};
};

// A request that the router passes to a handler. Its caller has the required role.
struct Call {
  Request& request;
  Caller caller;
  std::vector<std::string> names;  // values of the {...} segments of the pattern

  // Returns the value of a query parameter; "" if it is missing.
  std::string query(const std::string& name) const;
  // Returns the value of a query parameter with an IntegerRange. Throws Problem (400) if the value
  // is outside the range.
  uint64_t query_integer(const Parameter& parameter) const;
};

struct Route {
  std::string method;
  std::string pattern;  // "/api/v1/jobs/{id}/dag". A GET route also answers HEAD.
  Role role = Role::kRead;
  // Operation id. A route without an id is not in the document.
  std::string id = {};
  std::string summary = {};
  std::string tag = {};
  // The query parameters that the router accepts. It rejects all other parameters with 400, unless
  // accepts_any_query is set.
  std::vector<Parameter> query = {};
  bool accepts_any_query = false;
  std::vector<Parameter> headers = {};
  std::optional<Content> body = {};
  bool is_body_required = true;
  std::vector<Answer> answers = {};
  // Statuses of the route's problems, in addition to kCommonProblems. Router::add() adds 507 to
  // routes that change something.
  std::vector<int> problems = {};
};

inline constexpr int kCommonProblems[] = {400, 401, 403, 429, 431, 500, 503};

// Returns the content of a body of type "application/json" with this schema; "" for any JSON.
inline Content json_content(std::string schema = "") {
  return {"application/json", std::move(schema)};
}

}  // namespace voxdag::server
