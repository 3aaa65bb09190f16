// The codes of Error in the outside world. One table, in docs/errors.md, maps a code to the exit
// status of the command line and to the HTTP status of the service; the functions below are that
// table in code.
#pragma once

#include <optional>
#include <string_view>

#include "voxdag/error.h"

namespace voxdag {

// The code of this name, if there is one.
std::optional<ErrorCode> error_code_named(std::string_view name);
// Exit status of the command line for a code; never 0.
int exit_status(ErrorCode code);
// HTTP status of the service for a code.
int http_status(ErrorCode code);

}  // namespace voxdag
