// Sends requests over HTTP or HTTPS to one server, and keeps the connection open between requests.
// Used by one thread, except stop() and received().
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "client/http/http_connection.h"
#include "core/base/error.h"

namespace voxdag::client {

// Documented at HttpConnection. The constructor throws Error{kInvalidInput} for a malformed URL.
class HttpClient {
 public:
  explicit HttpClient(const ClientOptions& options) : connection_(open_http(options)) {}

  ClientResponse get(const std::string& path, const HeaderMap& headers = {}) {
    return connection_->get(path, headers);
  }
  ClientResponse head(const std::string& path, const HeaderMap& headers = {}) {
    return connection_->head(path, headers);
  }
  ClientResponse send(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {}) {
    return connection_->send(method, path, body, headers);
  }
  int send_for_status(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers = {}) {
    return connection_->send_for_status(method, path, body, headers);
  }
  void stop() { connection_->stop(); }
  uint64_t received() const { return connection_->received(); }
  ClientResponse upload(const std::string& path, uint64_t size,
                        const HttpConnection::Source& source, const HeaderMap& headers = {}) {
    return connection_->upload(path, size, source, headers);
  }
  ClientResponse stream(const std::string& path, const HeaderMap& headers,
                        const HttpConnection::Begin& begin, const HttpConnection::Sink& sink) {
    return connection_->stream(path, headers, begin, sink);
  }

 private:
  std::unique_ptr<HttpConnection> connection_;
};

// Returns the error code named `name` in docs/errors.md. If there is no such code, returns kIo for
// an HTTP status of 500 or above, and kInvalidInput for a lower status.
ErrorCode error_code_of(const std::string& name, int http_status);
// Throws the Error that an answer in the form problem+json (RFC 9457) describes. Returns if the
// status is below 400.
void throw_if_problem(const ClientResponse& response);

}  // namespace voxdag::client
