#include "server/request_error.h"

namespace voxdag::server {

const char* RequestError::code() const {
  switch (kind_) {
    case Kind::kInvalid:
      return error_name(ErrorCode::kInvalidInput);
    case Kind::kNotFound:
      return error_name(ErrorCode::kNotFound);
    case Kind::kLimit:
      return error_name(ErrorCode::kLimit);
    case Kind::kConflict:
      return "conflict";
    case Kind::kKeyReused:
      return "idempotency_mismatch";
    case Kind::kQueueFull:
      return "busy";
  }
  return "";
}

const char* public_text(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidInput:
      return "the request breaks a rule";
    case ErrorCode::kNotFound:
      return "what was asked for is not there";
    case ErrorCode::kCorrupt:
      return "stored data fail their checks; the service's log says which";
    case ErrorCode::kUnsupportedVersion:
      return "a format version that this service does not read";
    case ErrorCode::kIo:
      return "the system refused to read or write; the service's log says what";
    case ErrorCode::kNoSpace:
      return "the service's disk is full";
    case ErrorCode::kOutOfMemory:
      return "the service has not enough memory for this";
    case ErrorCode::kDevice:
      return "the GPU or its driver failed";
    case ErrorCode::kCanceled:
      return "stopped before it was done";
    case ErrorCode::kLimit:
      return "a limit is exceeded";
  }
  return "";
}

}  // namespace voxdag::server
