// The answer to a failed request: problem+json (RFC 9457). Handlers throw it as an exception.
//
// `detail` is shown to clients, so it never contains paths of the server or texts of libraries.
#pragma once

#include <exception>
#include <string>

#include "core/base/error.h"
#include "server/http/message/headers.h"
#include "server/http/message/message.h"

namespace voxdag::server {

struct Problem : std::exception {
  Problem(int http_status, std::string name, std::string text)
      : status(http_status), code(std::move(name)), detail(std::move(text)) {}
  const char* what() const noexcept override { return detail.c_str(); }

  int status;
  std::string code;
  std::string detail;
  std::string state;     // state of a job that does not allow the request; "" otherwise
  std::string log_text;  // for the log only; "" for no text
  HeaderMap headers;     // fields of the answer: Retry-After, Allow, Content-Range, ...
};

// Returns the problem for an error code, with the status of docs/errors.md.
Problem problem(ErrorCode code, std::string detail);
Problem bad_request(std::string detail);
Problem not_found(std::string detail);
Problem conflict(std::string detail);
// Returns the problem 503 with a Retry-After header.
Problem busy(std::string detail, int retry_after_s = 2);

std::string problem_json(const Problem& problem);
Response problem_response(const Problem& problem);
// Returns the title of a status, such as "Not Found"; "" for a status that this service does not
// use.
const char* status_title(int status);

}  // namespace voxdag::server
