// Errors of the queue, scenes, jobs and tiles for faulty requests. They throw a RequestError if the
// client can correct the request, and an Error otherwise; server/api turns both into answers. The
// message of a RequestError is written for clients and has no path of the server. The message of an
// Error may have one, and public_error() replaces it.
#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <string>

#include "core/base/error.h"

namespace voxdag::server {

class RequestError : public std::exception {
 public:
  // Tables of code() and server/api are in this order.
  enum class Kind {
    kInvalid,    // breaks a rule
    kNotFound,   // names a job or scene that is not there
    kLimit,      // asks for more than the service allows
    kConflict,   // does not fit the present state of the job, scene or upload
    kKeyReused,  // brings the idempotency key of another request
    kBusy,       // can be repeated later
  };
  static constexpr size_t kKinds = static_cast<size_t>(Kind::kBusy) + 1;

  RequestError(Kind kind, std::string message) : kind_(kind), message_(std::move(message)) {}
  Kind kind() const { return kind_; }
  // The stable name of the kind: "invalid_input", "conflict", ...
  const char* code() const;
  const std::string& message() const { return message_; }
  const char* what() const noexcept override { return message_.c_str(); }

  std::string job_state;                  // of a conflicting job; "" elsewhere
  std::optional<uint64_t> upload_offset;  // where a conflicting upload continues
  int retry_after_s = 60;                 // when to repeat a request that was kBusy

 private:
  Kind kind_;
  std::string message_;
};

// What clients see of an exception: a RequestError keeps its message, an Error its code. The code
// of anything else is "internal".
struct PublicError {
  std::string code;
  std::string text;
};
PublicError public_error(const std::exception& error);

}  // namespace voxdag::server
