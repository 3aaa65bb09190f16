// Limits of the listener, per client and in total. Each phase of a connection has a time limit, so
// that a client that sends very slowly cannot occupy a connection for long.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag::server {

struct HttpLimits {
  // If the table has this number of connections, a new connection replaces the connection that has
  // waited longest.
  size_t max_connections = 512;
  size_t max_per_client = 256;      // the loopback (a proxy) is exempt
  size_t max_header_bytes = 32768;  // request line and header fields together
  double header_timeout_s = 10;     // from a request's first byte to the end of its header
  double idle_timeout_s = 30;       // between requests
  double grace_s = 20;              // max time by which a client may be behind the minimum rate
  double min_bytes_per_s = 1024;    // min rate of a body or an answer
  size_t max_requests = 10000;      // requests per connection
};

}  // namespace voxdag::server
