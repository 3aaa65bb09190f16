// The head of an HTTP/1.1 request (RFC 9112): request line and header fields. The parser is strict.
// It refuses text that a proxy in front of the service could interpret differently: a folded line,
// a blank before a colon, a lone LF, two lengths.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/http/message/headers.h"

namespace voxdag::server {

struct RequestHead {
  std::string method;
  std::string target;  // as sent
  HeaderMap headers;
  std::optional<uint64_t> content_length;
  bool chunked = false;
  bool is_http_1_0 = false;
  bool expects_continue = false;  // the client waits for "100 Continue" before it sends the body
  bool keep_alive = true;         // another request may follow on the connection
};

// Parses a head including the empty line at its end. Throws Problem.
RequestHead parse_request_head(std::string_view text);

}  // namespace voxdag::server
