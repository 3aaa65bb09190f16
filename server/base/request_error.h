// The queue, scenes, jobs and tiles throw a RequestError if the client can correct the request, and
// an Error otherwise. server/api converts both to answers. The message of a RequestError is for
// clients and contains no path of the server. The message of an Error may contain such a path, so
// public_error() replaces it.
#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <string>

#include "core/base/error.h"

namespace voxdag::server {

class RequestError : public std::exception {
 public:
  // code() and server/api have tables whose entries are in the order of these values.
  enum class Kind {
    kInvalid,    // the request breaks a rule
    kNotFound,   // the job or scene does not exist
    kLimit,      // the request exceeds a limit of the service
    kConflict,   // the job, scene or upload is in another state
    kKeyReused,  // the idempotency key was used by another request
    kBusy,       // the request can be repeated later
  };
  static constexpr size_t kKinds = static_cast<size_t>(Kind::kBusy) + 1;

  RequestError(Kind kind, std::string message) : kind_(kind), message_(std::move(message)) {}
  Kind kind() const { return kind_; }
  // The stable name of the kind: "invalid_input", "conflict", ...
  const char* code() const;
  const std::string& message() const { return message_; }
  const char* what() const noexcept override { return message_.c_str(); }

  std::string job_state;                  // state of a conflicting job; "" for other errors
  std::optional<uint64_t> upload_offset;  // offset at which a conflicting upload continues
  int retry_after_s = 60;                 // delay before repeating a request that was kBusy

 private:
  Kind kind_;
  std::string message_;
};

// The part of an exception that clients see. A RequestError keeps its code and message. An Error
// keeps its code and gets a fixed text. std::bad_alloc is shown as the error "out_of_memory", and
// any other exception as "internal".
struct PublicError {
  std::string code;
  std::string text;
};
PublicError public_error(const std::exception& error);

}  // namespace voxdag::server
