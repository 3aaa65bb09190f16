#include "server/api/request_problem.h"

namespace voxdag::server {
namespace {

constexpr int kQueueFullRetry_s = 60;

}  // namespace

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

}  // namespace voxdag::server
