// Sends requests over HTTP or HTTPS to one server. Keeps the connection open between requests. Only
// http_client.cc includes httplib. Used by one thread.
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
  // Returns the first field with this name, ignoring case; "" if none exists.
  std::string header(std::string_view name) const;
};

struct ClientOptions {
  std::string url;        // http://host:port or https://host[:port], no path
  std::string token;      // "": no token
  std::string ca_file;    // certificates to trust; "": the system's certificates
  double timeout_s = 30;  // for connecting, and for each read and write
};

// The constructor throws Error{kInvalidInput} for a malformed URL; requests throw Error{kIo} if the
// server cannot be reached or the connection breaks. Answers with an error status do not throw.
class HttpClient {
 public:
  explicit HttpClient(const ClientOptions& options);
  ~HttpClient();

  ClientResponse get(const std::string& path, const HeaderMap& headers = {});
  ClientResponse head(const std::string& path, const HeaderMap& headers = {});
  // `method` is POST, PUT, PATCH or DELETE. A non-empty body is sent as application/json.
  ClientResponse send(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {});

  // PUTs `size` bytes. source(offset, max_bytes) returns the next bytes, at least one.
  using Source = std::function<std::string(uint64_t offset, uint64_t max_bytes)>;
  ClientResponse upload(const std::string& path, uint64_t size, const Source& source,
                        const HeaderMap& headers = {});

  // GETs a body in pieces, for downloads and event streams. `begin` receives the status and
  // headers, `sink` the body. If either returns false, the connection is closed, which is not an
  // error. If the status is 400 or above, the body goes to the returned response instead of the
  // sink.
  using Begin = std::function<bool(const ClientResponse&)>;
  using Sink = std::function<bool(std::string_view piece)>;
  ClientResponse stream(const std::string& path, const HeaderMap& headers, const Begin& begin,
                        const Sink& sink);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Returns the code with this name (docs/errors.md), else the code that fits the HTTP status best.
ErrorCode error_code_of(const std::string& name, int http_status);
// Throws the Error that a problem+json answer describes (status 400 and above).
void throw_if_problem(const ClientResponse& response);

}  // namespace voxdag::client
