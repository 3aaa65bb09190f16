#include "server/api/answers/public_problem.h"

#include <new>

#include "server/base/request_error.h"

namespace voxdag::server {
namespace {

Problem problem_of(const RequestError& error) {
  static constexpr int kStatuses[] = {400, 404, 422, 409, 422, 503};
  static_assert(std::size(kStatuses) == RequestError::kKinds);
  Problem result(kStatuses[static_cast<size_t>(error.kind())], error.code(), error.message());
  if (error.kind() == RequestError::Kind::kBusy)
    result.headers.emplace("Retry-After", std::to_string(error.retry_after_s));
  result.state = error.job_state;
  if (error.upload_offset)
    result.headers.emplace("Upload-Offset", std::to_string(*error.upload_offset));
  return result;
}

}  // namespace

Problem public_problem(const std::exception& error) {
  if (const auto* problem = dynamic_cast<const Problem*>(&error)) return *problem;
  if (const auto* refused = dynamic_cast<const RequestError*>(&error)) return problem_of(*refused);
  const auto& [code, text] = public_error(error);
  if (const auto* known = dynamic_cast<const Error*>(&error)) return problem(known->code(), text);
  if (dynamic_cast<const std::bad_alloc*>(&error)) return busy(text);
  return Problem(500, code, text);
}

}  // namespace voxdag::server
