#include "server/http/message/problem.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "core/base/text/printable.h"
#include "core/fields/json_text.h"

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

std::string problem_json(const Problem& problem) {
  nlohmann::ordered_json json = {{"type", "about:blank"},
                                 {"title", status_title(problem.status)},
                                 {"status", problem.status},
                                 {"code", problem.code},
                                 {"detail", printable_line(problem.detail)}};
  if (!problem.state.empty()) json["state"] = problem.state;
  return json_text(json);
}

Response problem_response(const Problem& problem) {
  Response response =
      make_response(problem.status, "application/problem+json", "no-store", problem_json(problem));
  response.headers.insert(problem.headers.begin(), problem.headers.end());
  return response;
}

const char* status_title(int status) {
  static constexpr std::pair<int, const char*> kTitles[] = {
      {200, "OK"},
      {201, "Created"},
      {202, "Accepted"},
      {204, "No Content"},
      {206, "Partial Content"},
      {304, "Not Modified"},
      {400, "Bad Request"},
      {401, "Unauthorized"},
      {403, "Forbidden"},
      {404, "Not Found"},
      {405, "Method Not Allowed"},
      {408, "Request Timeout"},
      {409, "Conflict"},
      {410, "Gone"},
      {413, "Content Too Large"},
      {414, "URI Too Long"},
      {415, "Unsupported Media Type"},
      {416, "Range Not Satisfiable"},
      {422, "Unprocessable Content"},
      {429, "Too Many Requests"},
      {431, "Request Header Fields Too Large"},
      {500, "Internal Server Error"},
      {503, "Service Unavailable"},
      {507, "Insufficient Storage"},
  };
  for (const auto& [code, title] : kTitles)
    if (code == status) return title;
  return "";
}

}  // namespace voxdag::server
