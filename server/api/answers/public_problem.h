// Converts the exception of a handler to the problem sent to the client.
#pragma once

#include <exception>

#include "server/http/message/problem.h"

namespace voxdag::server {

// A Problem is returned unchanged, and a RequestError keeps its message. An Error keeps its code,
// but its message is replaced by a fixed text, because it may contain paths of the server.
// std::bad_alloc becomes the problem `busy`; any other exception becomes the problem `internal`.
Problem public_problem(const std::exception& error);

}  // namespace voxdag::server
