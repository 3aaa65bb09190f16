// What one client, and all together, may ask of the listener. Times bound a connection's phases, so
// that dripping bytes wins nobody a place for long.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag::server {

struct HttpLimits {
  size_t connections = 512;       // at a time; the longest waiting one makes place for a new one
  size_t per_address = 256;       // of one client; the loopback (a proxy) is exempt
  size_t header_bytes = 32768;    // request line and header fields together
  double header_s = 10;           // from a request's first byte to the end of its header
  double idle_s = 30;             // between requests
  double grace_s = 20;            // body, answer: silence that is forgiven
  double min_bytes_per_s = 1024;  // bytes per second beyond that, body and answer
  size_t requests_each = 10000;   // on one connection
};

}  // namespace voxdag::server
