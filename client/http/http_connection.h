// A connection of an HttpClient to its server. httplib is included only in http_connection.cc,
// because the program voxdag loads httplib only when a command needs it (cli/modules/modules.h).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "client/http/http_message.h"

namespace voxdag::client {

// Requests throw Error{kIo} if the server cannot be reached or the connection breaks. An answer
// with an error status is returned, not thrown.
class HttpConnection {
 public:
  virtual ~HttpConnection() = default;

  virtual ClientResponse get(const std::string& path, const HeaderMap& headers) = 0;
  virtual ClientResponse head(const std::string& path, const HeaderMap& headers) = 0;
  // Sends a request and returns the answer. `method` is POST, PUT, PATCH or DELETE. A body that is
  // not empty is sent as application/json, unless `headers` has a Content-Type.
  virtual ClientResponse send(const std::string& method, const std::string& path,
                              const std::string& body, const HeaderMap& headers) = 0;

  // Sends a request like send() and returns the status of the answer. Closes the connection before
  // the body of the answer arrives, so the answer may have any size.
  virtual int send_for_status(const std::string& method, const std::string& path,
                              const std::string& body, const HeaderMap& headers) = 0;

  // Shuts down the connection of a request in progress, which then throws Error{kIo}. Any thread
  // may call it, also while the connection is being opened. It does not wait. It has no effect
  // before the socket exists, so callers repeat it until the request ends.
  virtual void stop() = 0;
  // Returns the number of bytes that the newest connection has received, with TLS and headers. The
  // result is 0 before the first connection. Any thread may call it.
  virtual uint64_t received() = 0;

  // Sends `size` bytes with PUT. source(offset, max_bytes) must return the bytes from `offset` on:
  // at least one and at most max_bytes.
  using Source = std::function<std::string(uint64_t offset, uint64_t max_bytes)>;
  virtual ClientResponse upload(const std::string& path, uint64_t size, const Source& source,
                                const HeaderMap& headers) = 0;

  // Fetches a body in pieces with GET, for downloads and event streams. `begin` is called with the
  // status and headers, `sink` with each piece of the body. If one of them returns false, the
  // connection is closed; this is not an error. If the status is 400 or above, the body is stored
  // in the returned response instead of being passed to `sink`.
  using Begin = std::function<bool(const ClientResponse&)>;
  using Sink = std::function<bool(std::string_view piece)>;
  virtual ClientResponse stream(const std::string& path, const HeaderMap& headers,
                                const Begin& begin, const Sink& sink) = 0;
};

// Does not connect: the first request does. Throws Error{kInvalidInput} for a malformed URL.
std::unique_ptr<HttpConnection> open_http(const ClientOptions& options);
// True if this build can use https://.
bool supports_https();

}  // namespace voxdag::client
