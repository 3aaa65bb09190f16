#include "server/api/problem.h"

#include <nlohmann/json.hpp>

#include "server/request_error.h"

namespace voxdag::server {
Problem problem(ErrorCode code, std::string detail) {
  return Problem(http_status(code), error_name(code), std::move(detail));
}
Problem bad_request(std::string detail) {
  return problem(ErrorCode::kInvalidInput, std::move(detail));
}
Problem not_found(std::string detail) { return problem(ErrorCode::kNotFound, std::move(detail)); }
Problem conflict(std::string detail) { return Problem(409, "conflict", std::move(detail)); }

Problem busy(std::string detail, int retry_after_s) {
  Problem result(503, "busy", std::move(detail));
  result.headers.emplace("Retry-After", std::to_string(retry_after_s));
  return result;
}

Problem public_problem(const Error& error) {
  return problem(error.code(), public_text(error.code()));
}

std::string problem_json(const Problem& problem) {
  nlohmann::ordered_json json = {{"type", "about:blank"},
                                 {"title", status_title(problem.status)},
                                 {"status", problem.status},
                                 {"code", problem.code},
                                 {"detail", problem.detail}};
  if (!problem.state.empty()) json["state"] = problem.state;
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

const char* status_title(int status) {
  switch (status) {
    case 400:
      return "Bad Request";
    case 401:
      return "Unauthorized";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 408:
      return "Request Timeout";
    case 409:
      return "Conflict";
    case 413:
      return "Content Too Large";
    case 414:
      return "URI Too Long";
    case 415:
      return "Unsupported Media Type";
    case 416:
      return "Range Not Satisfiable";
    case 422:
      return "Unprocessable Content";
    case 429:
      return "Too Many Requests";
    case 431:
      return "Request Header Fields Too Large";
    case 500:
      return "Internal Server Error";
    case 503:
      return "Service Unavailable";
    case 507:
      return "Insufficient Storage";
    default:
      return "";
  }
}

}  // namespace voxdag::server
