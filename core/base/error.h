// Maps Error codes to the exit statuses of the command line and to the HTTP statuses of the
// service. The functions below implement the table in docs/errors.md.
#pragma once

#include <optional>
#include <string_view>

#include "voxdag/error.h"

namespace voxdag {

// Returns the code with this name; nullopt if no code has this name.
std::optional<ErrorCode> error_code_named(std::string_view name);
// Returns the exit status of the command line for a code; never 0.
int exit_status(ErrorCode code);
// Returns the HTTP status of the service for a code.
int http_status(ErrorCode code);

}  // namespace voxdag
