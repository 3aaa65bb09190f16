// Tells how much a server has sent.
#pragma once

#include <cstdint>

namespace voxdag::client {

// Returns the number of bytes that a TCP connection has received, with TLS and headers; 0 if the
// system does not count them. Does not read from the connection.
uint64_t received_bytes(int socket);

}  // namespace voxdag::client
