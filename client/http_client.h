// Sends requests over HTTP or HTTPS to one server, and keeps the connection open between requests.
// httplib is included only in http_client.cc. Used by one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace voxdag::client {

// Header fields by name. In an answer, names are in lower case.
using HeaderMap = std::multimap<std::string, std::string>;

struct ClientResponse {
  int status = 0;
  HeaderMap headers;
  std::string body;  // empty if a sink received it
  // Returns the value of the first header field with this name, ignoring case; "" if no field has
  // the name.
  std::string header(std::string_view name) const;
};

struct ClientOptions {
  std::string url;               // http://host:port or https://host[:port], without a path
  std::string token;             // "": no token
  std::string ca_file;           // file of certificates to trust; "": the system's certificates
  double timeout_s = 30;         // limit for connecting, and for each read and write
  double connect_timeout_s = 0;  // if not 0, replaces timeout_s for connecting
};

// The constructor throws Error{kInvalidInput} for a malformed URL. Requests throw Error{kIo} if the
// server cannot be reached or the connection breaks. An answer with an error status is returned,
// not thrown.
class HttpClient {
 public:
  explicit HttpClient(const ClientOptions& options);
  ~HttpClient();

  ClientResponse get(const std::string& path, const HeaderMap& headers = {});
  ClientResponse head(const std::string& path, const HeaderMap& headers = {});
  // Sends a request and returns the answer. `method` is POST, PUT, PATCH or DELETE. A body that is
  // not empty is sent as application/json, unless `headers` has a Content-Type.
  ClientResponse send(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {});

  // Sends a request like send() and returns the status of the answer. Closes the connection before
  // the body of the answer arrives, so the answer may have any size.
  int send_for_status(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {});

  // Shuts down the connection of a request in progress, which then throws Error{kIo}. Any thread
  // may call it, also while the connection is being opened. It does not wait. It has no effect
  // before the socket exists, so callers repeat it until the request ends.
  void stop();
  // Returns the number of bytes that the newest connection has received, with TLS and headers. The
  // result is 0 before the first connection. Any thread may call it.
  uint64_t received() const;

  // Sends `size` bytes with PUT. source(offset, max_bytes) must return the bytes from `offset` on:
  // at least one and at most max_bytes.
  using Source = std::function<std::string(uint64_t offset, uint64_t max_bytes)>;
  ClientResponse upload(const std::string& path, uint64_t size, const Source& source,
                        const HeaderMap& headers = {});

  // Fetches a body in pieces with GET, for downloads and event streams. `begin` is called with the
  // status and headers, `sink` with each piece of the body. If one of them returns false, the
  // connection is closed; this is not an error. If the status is 400 or above, the body is stored
  // in the returned response instead of being passed to `sink`.
  using Begin = std::function<bool(const ClientResponse&)>;
  using Sink = std::function<bool(std::string_view piece)>;
  ClientResponse stream(const std::string& path, const HeaderMap& headers, const Begin& begin,
                        const Sink& sink);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// True if this build can use https://.
bool supports_https();
// Returns the error code named `name` in docs/errors.md. If there is no such code, returns kIo for
// an HTTP status of 500 or above, and kInvalidInput for a lower status.
ErrorCode error_code_of(const std::string& name, int http_status);
// Throws the Error that an answer in the form problem+json (RFC 9457) describes. Returns if the
// status is below 400.
void throw_if_problem(const ClientResponse& response);

}  // namespace voxdag::client
