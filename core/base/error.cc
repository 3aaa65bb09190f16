#include "core/base/error.h"

namespace voxdag {
namespace {

struct Row {
  ErrorCode code;
  const char* name;
  int exit_status;
  int http_status;
};

// docs/errors.md shows this table to users. 130 is the exit status that a shell reports after
// Ctrl-C.
constexpr Row kTable[] = {
    {ErrorCode::kInvalidInput, "invalid_input", 2, 400},
    {ErrorCode::kNotFound, "not_found", 3, 404},
    {ErrorCode::kCorrupt, "corrupt", 4, 500},
    {ErrorCode::kUnsupportedVersion, "unsupported_version", 5, 400},
    {ErrorCode::kIo, "io", 6, 500},
    {ErrorCode::kNoSpace, "no_space", 7, 507},
    {ErrorCode::kOutOfMemory, "out_of_memory", 8, 503},
    {ErrorCode::kDevice, "device", 9, 422},
    {ErrorCode::kCanceled, "canceled", 130, 409},
    {ErrorCode::kLimit, "limit", 10, 422},
};

const Row& row(ErrorCode code) {
  for (const Row& r : kTable)
    if (r.code == code) return r;
  return kTable[0];
}

}  // namespace

const char* error_name(ErrorCode code) { return row(code).name; }
std::optional<ErrorCode> error_code_named(std::string_view name) {
  for (const Row& r : kTable)
    if (name == r.name) return r.code;
  return {};
}
int exit_status(ErrorCode code) { return row(code).exit_status; }
int http_status(ErrorCode code) { return row(code).http_status; }

}  // namespace voxdag
