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

}  // namespace voxdag::server
