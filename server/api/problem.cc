#include "server/api/problem.h"

namespace voxdag::server {
namespace {

const char* public_text(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidInput:
      return "the request is invalid";
    case ErrorCode::kNotFound:
      return "not found";
    case ErrorCode::kCorrupt:
      return "stored data are corrupt; the log of the service has the details";
    case ErrorCode::kUnsupportedVersion:
      return "this service does not read this format version";
    case ErrorCode::kIo:
      return "reading or writing a file failed; the log of the service has the details";
    case ErrorCode::kNoSpace:
      return "the disk of the service is full";
    case ErrorCode::kOutOfMemory:
      return "the service does not have enough memory for this request";
    case ErrorCode::kDevice:
      return "the GPU or its driver failed";
    case ErrorCode::kCanceled:
      return "canceled";
    case ErrorCode::kLimit:
      return "a limit is exceeded";
  }
  return "";
}

}  // namespace

Problem public_problem(const std::exception& error) {
  if (const auto* problem = dynamic_cast<const Problem*>(&error)) return *problem;
  if (const auto* known = dynamic_cast<const Error*>(&error))
    return problem(known->code(), public_text(known->code()));
  if (dynamic_cast<const std::bad_alloc*>(&error))
    return busy("the service does not have enough memory for this request");
  return Problem(500, "internal", "internal error; the log of the service has the request id");
}

}  // namespace voxdag::server
