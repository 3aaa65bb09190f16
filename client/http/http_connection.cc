#include "client/http/http_connection.h"

#include <fcntl.h>
#include <httplib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <exception>
#include <mutex>

#include "client/http/received_bytes.h"
#include "core/base/error.h"

namespace voxdag::client {
namespace {

constexpr uint64_t kUploadPieceBytes = 256 << 10;

// Converts headers to httplib's type. Unless the caller sets Accept-Encoding, adds this header with
// the value "identity", because newer versions of httplib would otherwise request compressed
// bodies.
httplib::Headers to_httplib(const HeaderMap& headers) {
  httplib::Headers all(headers.begin(), headers.end());
  if (all.find("Accept-Encoding") == all.end()) all.emplace("Accept-Encoding", "identity");
  return all;
}

ClientResponse from_httplib(const httplib::Response& response) {
  ClientResponse result;
  result.status = response.status;
  for (const auto& [name, value] : response.headers)
    result.headers.emplace(lower_case(name), value);
  result.body = response.body;
  return result;
}

void check_url(const std::string& url) {
  for (const std::string_view scheme : {"http://", "https://"})
    if (url.starts_with(scheme) && url.size() > scheme.size() &&
        url.find('/', scheme.size()) == std::string::npos)
      return;
  throw Error(ErrorCode::kInvalidInput,
              "server '" + url + "': expected http://HOST:PORT or https://HOST[:PORT]");
}

// A duplicate of the descriptor of the newest socket, so that another thread can shut the socket
// down. httplib::Client::stop() cannot do that: it waits while a connection is being opened, and a
// server that sends its part of a TLS handshake byte by byte prolongs this time without limit.
// Thread-safe.
class SocketHandle {
 public:
  SocketHandle() = default;
  SocketHandle(const SocketHandle&) = delete;
  ~SocketHandle() { set(-1); }

  void duplicate(int socket) { set(fcntl(socket, F_DUPFD_CLOEXEC, 0)); }
  void shut_down() {
    std::lock_guard lock(mutex_);
    if (descriptor_ >= 0) shutdown(descriptor_, SHUT_RDWR);
  }
  uint64_t received() {
    std::lock_guard lock(mutex_);
    return descriptor_ >= 0 ? received_bytes(descriptor_) : 0;
  }

 private:
  void set(int descriptor) {
    std::lock_guard lock(mutex_);
    if (descriptor_ >= 0) close(descriptor_);
    descriptor_ = descriptor;
  }

  std::mutex mutex_;
  int descriptor_ = -1;  // -1: none
};

httplib::Request request_of(const std::string& method, const std::string& path,
                            const std::string& body, const HeaderMap& headers) {
  httplib::Request request;
  request.method = method;
  request.path = path;
  request.headers = to_httplib(headers);
  request.body = body;
  if (!body.empty() && !request.has_header("Content-Type"))
    request.set_header("Content-Type", "application/json");
  return request;
}

class HttplibConnection : public HttpConnection {
 public:
  explicit HttplibConnection(const ClientOptions& options) : url_(options.url), http_(options.url) {
    if (!http_.is_valid())
      throw Error(ErrorCode::kInvalidInput, "server '" + url_ +
                                                "' is not a valid address: expected "
                                                "http://HOST:PORT or https://HOST[:PORT]");
    const auto timeout = std::chrono::microseconds(static_cast<int64_t>(options.timeout_s * 1e6));
    const double connect_s =
        options.connect_timeout_s > 0 ? options.connect_timeout_s : options.timeout_s;
    http_.set_connection_timeout(std::chrono::microseconds(static_cast<int64_t>(connect_s * 1e6)));
    http_.set_read_timeout(timeout);
    http_.set_write_timeout(timeout);
    http_.set_keep_alive(true);
    http_.set_tcp_nodelay(true);
    http_.set_socket_options([this](int created) { socket_.duplicate(created); });
    http_.set_decompress(false);
    http_.set_url_encode(false);  // callers pass encoded paths
    if (!options.token.empty()) http_.set_bearer_token_auth(options.token.c_str());
    if (!options.ca_file.empty()) http_.set_ca_cert_path(options.ca_file.c_str());
  }

  ClientResponse get(const std::string& path, const HeaderMap& headers) override;
  ClientResponse head(const std::string& path, const HeaderMap& headers) override;
  ClientResponse send(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers) override;
  int send_for_status(const std::string& method, const std::string& path, const std::string& body,
                      const HeaderMap& headers) override;
  void stop() override { socket_.shut_down(); }
  uint64_t received() override { return socket_.received(); }
  ClientResponse upload(const std::string& path, uint64_t size, const Source& source,
                        const HeaderMap& headers) override;
  ClientResponse stream(const std::string& path, const HeaderMap& headers, const Begin& begin,
                        const Sink& sink) override;

 private:
  ClientResponse check(const httplib::Result& result) const {
    if (!result && result.error() == httplib::Error::SSLServerVerification)
      throw Error(ErrorCode::kIo,
                  "server " + url_ +
                      ": its certificate is not trusted, or is for another name: expected a "
                      "certificate that the system or the given CA file trusts");
    if (!result && result.error() == httplib::Error::Connection)
      throw Error(ErrorCode::kIo, "server " + url_ +
                                      ": no connection: expected a server that accepts connections "
                                      "at this address");
    if (!result)
      throw Error(ErrorCode::kIo, "server " + url_ + ": " + httplib::to_string(result.error()) +
                                      ": expected an answer");
    return from_httplib(*result);
  }

  const std::string url_;
  SocketHandle socket_;
  httplib::Client http_;
};

ClientResponse HttplibConnection::get(const std::string& path, const HeaderMap& headers) {
  return check(http_.Get(path, to_httplib(headers)));
}

ClientResponse HttplibConnection::head(const std::string& path, const HeaderMap& headers) {
  return check(http_.Head(path, to_httplib(headers)));
}

ClientResponse HttplibConnection::send(const std::string& method, const std::string& path,
                                       const std::string& body, const HeaderMap& headers) {
  return check(http_.send(request_of(method, path, body, headers)));
}

int HttplibConnection::send_for_status(const std::string& method, const std::string& path,
                                       const std::string& body, const HeaderMap& headers) {
  httplib::Request request = request_of(method, path, body, headers);
  int status = 0;
  request.response_handler = [&](const httplib::Response& response) {
    status = response.status;
    return false;  // closes the connection
  };
  const auto result = http_.send(request);
  return status != 0 ? status : check(result).status;
}

ClientResponse HttplibConnection::upload(const std::string& path, uint64_t size,
                                         const Source& source, const HeaderMap& headers) {
  // `source` may throw, but exceptions must not propagate through httplib. So `failure` stores the
  // exception, and it is thrown again after the request.
  std::exception_ptr failure;
  const auto provider = [&](size_t offset, size_t length, httplib::DataSink& sink) {
    try {
      const std::string piece = source(offset, std::min<uint64_t>(length, kUploadPieceBytes));
      return sink.write(piece.data(), piece.size());
    } catch (...) {
      failure = std::current_exception();
      return false;
    }
  };
  const auto result = http_.Put(path, to_httplib(headers), static_cast<size_t>(size), provider,
                                "application/octet-stream");
  if (failure) std::rethrow_exception(failure);
  return check(result);
}

ClientResponse HttplibConnection::stream(const std::string& path, const HeaderMap& headers,
                                         const Begin& begin, const Sink& sink) {
  ClientResponse head;
  std::string error_body;
  bool closed = false;
  std::exception_ptr failure;
  // Calls `begin` or `sink`. They may throw, but exceptions must not propagate through httplib. So
  // `failure` stores the exception, and it is thrown again after the request.
  const auto guarded = [&](const auto& step) {
    try {
      if (step()) return true;
      closed = true;
    } catch (...) {
      failure = std::current_exception();
    }
    return false;
  };
  const auto result = http_.Get(
      path, to_httplib(headers),
      [&](const httplib::Response& response) {
        head = from_httplib(response);
        return guarded([&] { return begin(head); });
      },
      [&](const char* data, size_t size) {
        const std::string_view piece(data, size);
        if (head.status < 400) return guarded([&] { return sink(piece); });
        error_body += piece;
        return error_body.size() < (1 << 20);
      });
  if (failure) std::rethrow_exception(failure);
  if (!closed) head = check(result);
  if (!error_body.empty()) head.body = error_body;
  return head;
}

}  // namespace

std::unique_ptr<HttpConnection> open_http(const ClientOptions& options) {
  check_url(options.url);
  return std::make_unique<HttplibConnection>(options);
}

bool supports_https() {
#ifdef CPPHTTPLIB_OPENSSL_SUPPORT
  return true;
#else
  return false;
#endif
}

}  // namespace voxdag::client
