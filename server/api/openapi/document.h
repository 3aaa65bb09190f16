// The OpenAPI 3.1 document of a router's routes.
#pragma once

#include <string>

#include "server/api/routing/router.h"

namespace voxdag::server {

// Returns the document as JSON. Throws std::logic_error if a route uses an unknown schema, status
// or path parameter.
std::string openapi_document(const Router& router);

}  // namespace voxdag::server
