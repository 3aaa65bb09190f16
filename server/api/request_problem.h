// The answer to a request that queue, scenes or jobs refuse.
#pragma once

#include "server/api/problem.h"
#include "server/request_error.h"

namespace voxdag::server {

Problem problem_of(const RequestError& error);

}  // namespace voxdag::server
