#include "server/base/request_error.h"

#include <iterator>
#include <new>
#include <utility>

namespace voxdag::server {
namespace {

// Returns the text that clients get instead of the message of an Error with this code.
const char* public_text(ErrorCode code) {
  static constexpr std::pair<ErrorCode, const char*> kTexts[] = {
      {ErrorCode::kInvalidInput, "the request is invalid"},
      {ErrorCode::kNotFound, "not found"},
      {ErrorCode::kCorrupt, "stored data are corrupt; the log of the service has the details"},
      {ErrorCode::kUnsupportedVersion, "this service does not read this format version"},
      {ErrorCode::kIo, "reading or writing a file failed; the log of the service has the details"},
      {ErrorCode::kNoSpace, "the disk of the service is full"},
      {ErrorCode::kOutOfMemory, "the service does not have enough memory for this request"},
      {ErrorCode::kDevice, "the GPU or its driver failed"},
      {ErrorCode::kCanceled, "canceled"},
      {ErrorCode::kLimit, "a limit is exceeded"},
  };
  static_assert(std::size(kTexts) == static_cast<size_t>(ErrorCode::kLimit) + 1);
  for (const auto& [known, text] : kTexts)
    if (known == code) return text;
  return "";
}

}  // namespace

const char* RequestError::code() const {
  static constexpr const char* kCodes[] = {"invalid_input",        "not_found", "limit", "conflict",
                                           "idempotency_mismatch", "busy"};
  static_assert(std::size(kCodes) == kKinds);
  return kCodes[static_cast<size_t>(kind_)];
}

PublicError public_error(const std::exception& error) {
  if (const auto* refused = dynamic_cast<const RequestError*>(&error))
    return {refused->code(), refused->message()};
  if (const auto* known = dynamic_cast<const Error*>(&error))
    return {error_name(known->code()), public_text(known->code())};
  if (dynamic_cast<const std::bad_alloc*>(&error))
    return {error_name(ErrorCode::kOutOfMemory), public_text(ErrorCode::kOutOfMemory)};
  return {"internal", "internal error; the log of the service has the details"};
}

}  // namespace voxdag::server
