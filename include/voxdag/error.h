// The exception type that all functions of voxdag throw, and its error codes.
#pragma once

#include <exception>
#include <string>
#include <utility>

namespace voxdag {

enum class ErrorCode {
  kInvalidInput,        // a scene, option or request that is not valid
  kNotFound,            // a file, job or scene that does not exist
  kCorrupt,             // bytes written by voxdag that fail their checks
  kUnsupportedVersion,  // a format version this build does not read
  kIo,                  // the system refused a read, a write or a sync
  kNoSpace,             // the disk is full
  kOutOfMemory,         // the memory budget or the machine is too small
  kDevice,              // the GPU or its driver failed
  kCanceled,            // the user canceled the operation
  kLimit,               // the input exceeds a limit of the format or of the arithmetic
};

// An error. The message is one sentence: the problem, its place (file, subvolume, scene node) and
// the expected input.
class Error : public std::exception {
 public:
  Error(ErrorCode code, std::string message) : code_(code), message_(std::move(message)) {}
  ErrorCode code() const { return code_; }
  const std::string& message() const { return message_; }
  // True if a file written by voxdag may be damaged, missing or of a different version. The work
  // that depends on this file must then be repeated. Other codes imply nothing about the files.
  bool is_corruption() const {
    return code_ == ErrorCode::kCorrupt || code_ == ErrorCode::kNotFound ||
           code_ == ErrorCode::kUnsupportedVersion;
  }
  const char* what() const noexcept override { return message_.c_str(); }

 private:
  ErrorCode code_;
  std::string message_;
};

// Returns the stable name of a code, as used in JSON reports: "invalid_input", "no_space", ...
const char* error_name(ErrorCode code);

}  // namespace voxdag
