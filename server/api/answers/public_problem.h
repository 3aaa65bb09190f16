// Converts the exception of a handler to the problem sent to the client.
#pragma once

#include <exception>

#include "server/http/message/problem.h"

namespace voxdag::server {

// If `error` is a Problem, returns it unchanged. The problem of a RequestError has the
// RequestError's message. The problem of an Error has the Error's code, but a fixed text instead of
// its message, because the message may contain paths of the server. std::bad_alloc becomes the
// problem `busy`; any other exception becomes the problem `internal`.
Problem public_problem(const std::exception& error);

}  // namespace voxdag::server
