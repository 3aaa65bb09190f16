// Requests over HTTP or HTTPS to one server. The connection is kept open between requests. httplib
// is included in http_client.cc only. Used by one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace voxdag::client {

// Header fields by name; the names in an answer are in lower case.
using HeaderMap = std::multimap<std::string, std::string>;

struct ClientResponse {
  int status = 0;
  HeaderMap headers;
  std::string body;  // empty if it was passed to a sink
  // The first field of this name, ignoring case; "" without one.
  std::string header(std::string_view name) const;
};

struct ClientOptions {
  std::string url;        // http://host:port or https://host[:port], no path
  std::string token;      // "" for none
  std::string ca_file;    // certificates to trust instead of the system's; "" for the system's
  double timeout_s = 30;  // to connect, and for each read and write
};

// The constructor throws Error{kInvalidInput} for a malformed URL; requests throw Error{kIo} if the
// server cannot be reached or the connection breaks. Answers with an error status do not throw.
class HttpClient {
 public:
  explicit HttpClient(const ClientOptions& options);
  ~HttpClient();

  ClientResponse get(const std::string& path, const HeaderMap& headers = {});
  ClientResponse head(const std::string& path, const HeaderMap& headers = {});
  // `method` is POST, PUT, PATCH or DELETE; a non-empty body is sent as application/json.
  ClientResponse send(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {});

  // PUTs `size` bytes: source(offset, max_bytes) returns the next, at least one.
  using Source = std::function<std::string(uint64_t offset, uint64_t max_bytes)>;
  ClientResponse upload(const std::string& path, uint64_t size, const Source& source,
                        const HeaderMap& headers = {});

  // GETs a body in pieces; for downloads and event streams. `begin` gets the status and headers,
  // `sink` the body; either returns false to close the connection, which is not an error. The body
  // of an answer with status 400 and above goes to the returned response instead of the sink.
  using Begin = std::function<bool(const ClientResponse&)>;
  using Sink = std::function<bool(std::string_view piece)>;
  ClientResponse stream(const std::string& path, const HeaderMap& headers, const Begin& begin,
                        const Sink& sink);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The code of this name (docs/errors.md), else the one that fits the HTTP status best.
ErrorCode error_code_of(const std::string& name, int http_status);
// Throws the Error described by a problem+json answer (status 400 and above).
void throw_if_problem(const ClientResponse& response);

}  // namespace voxdag::client
