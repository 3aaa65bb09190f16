// Converts the exception of a handler to the problem sent to the client.
#pragma once

#include <exception>

#include "server/http/message/problem.h"

namespace voxdag::server {

// A Problem is unchanged, and a RequestError keeps its message. An Error keeps its code, with a
// fixed text in place of its message, which may hold paths of the server. Anything else is `busy`
// (no memory) or `internal`.
Problem public_problem(const std::exception& error);

}  // namespace voxdag::server
