// Converts the exception of a handler to the problem sent to the client.
#pragma once

#include <exception>

#include "server/http/message/problem.h"

namespace voxdag::server {

// Returns a Problem unchanged. Keeps the message of a RequestError, and the code of an Error. The
// message of an Error is replaced by a fixed text, because it may contain paths of the server.
// std::bad_alloc becomes the problem `busy`; any other exception becomes the problem `internal`.
Problem public_problem(const std::exception& error);

}  // namespace voxdag::server
