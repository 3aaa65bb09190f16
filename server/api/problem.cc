#include "server/api/problem.h"

#include <new>

#include "server/request_error.h"

namespace voxdag::server {
namespace {

constexpr int kQueueFullRetry_s = 60;

Problem problem_of(const RequestError& error) {
  switch (error.kind()) {
    case RequestError::Kind::kInvalid:
      return bad_request(error.message());
    case RequestError::Kind::kNotFound:
      return not_found(error.message());
    case RequestError::Kind::kLimit:
      return problem(ErrorCode::kLimit, error.message());
    case RequestError::Kind::kKeyReused:
      return Problem(422, error.code(), error.message());
    case RequestError::Kind::kQueueFull:
      return busy(error.message(), kQueueFullRetry_s);
    case RequestError::Kind::kConflict:
      break;
  }
  Problem result = conflict(error.message());
  result.state = error.job_state;
  if (error.upload_offset)
    result.headers.emplace("Upload-Offset", std::to_string(*error.upload_offset));
  return result;
}

}  // namespace

Problem public_problem(const std::exception& error) {
  if (const auto* problem = dynamic_cast<const Problem*>(&error)) return *problem;
  if (const auto* refused = dynamic_cast<const RequestError*>(&error)) return problem_of(*refused);
  if (const auto* known = dynamic_cast<const Error*>(&error))
    return problem(known->code(), public_text(known->code()));
  if (dynamic_cast<const std::bad_alloc*>(&error))
    return busy(public_text(ErrorCode::kOutOfMemory));
  return Problem(500, "internal", "internal error; the log of the service has the request id");
}

}  // namespace voxdag::server
