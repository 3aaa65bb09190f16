// The content coding gzip (RFC 9110, 8.4.1.3). Stateless; thread-safe.
#pragma once

#include <string>
#include <string_view>

#include "server/http/message/message.h"

namespace voxdag::server {

// True if the value of Accept-Encoding allows gzip.
bool accepts_gzip(std::string_view accepted);
// Returns the compressed bytes. Throws Error{kOutOfMemory}.
std::string gzip(std::string_view bytes);

// Compresses the body of an answer if the client accepts gzip and the compressed body is smaller.
void pack(const Request& request, Response& response);

}  // namespace voxdag::server
