#include "client/http_client.h"

#include <fcntl.h>
#include <httplib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <mutex>
#include <nlohmann/json.hpp>

#include "client/received_bytes.h"
#include "core/fields/json_text.h"

namespace voxdag::client {
namespace {

constexpr uint64_t kUploadPieceBytes = 256 << 10;

// Converts only ASCII letters, independent of the locale.
std::string lower_case(std::string_view name) {
  std::string lower(name);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + ('a' - 'A'));
  return lower;
}

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

}  // namespace

std::string ClientResponse::header(std::string_view name) const {
  const auto found = headers.find(lower_case(name));
  return found == headers.end() ? "" : found->second;
}

struct HttpClient::Impl {
  explicit Impl(const ClientOptions& options) : url(options.url), http(options.url) {
    if (!http.is_valid())
      throw Error(ErrorCode::kInvalidInput, "server '" + url +
                                                "' is not a valid address: expected "
                                                "http://HOST:PORT or https://HOST[:PORT]");
    const auto timeout = std::chrono::microseconds(static_cast<int64_t>(options.timeout_s * 1e6));
    const double connect_s =
        options.connect_timeout_s > 0 ? options.connect_timeout_s : options.timeout_s;
    http.set_connection_timeout(std::chrono::microseconds(static_cast<int64_t>(connect_s * 1e6)));
    http.set_read_timeout(timeout);
    http.set_write_timeout(timeout);
    http.set_keep_alive(true);
    http.set_tcp_nodelay(true);
    http.set_socket_options([this](int created) { socket.duplicate(created); });
    http.set_decompress(false);
    http.set_url_encode(false);  // callers pass encoded paths
    if (!options.token.empty()) http.set_bearer_token_auth(options.token.c_str());
    if (!options.ca_file.empty()) http.set_ca_cert_path(options.ca_file.c_str());
  }

  ClientResponse check(const httplib::Result& result) const {
    if (!result && result.error() == httplib::Error::SSLServerVerification)
      throw Error(ErrorCode::kIo,
                  "server " + url +
                      ": its certificate is not trusted, or is for another name: expected a "
                      "certificate that the system or the given CA file trusts");
    if (!result && result.error() == httplib::Error::Connection)
      throw Error(ErrorCode::kIo, "server " + url +
                                      ": no connection: expected a server that accepts connections "
                                      "at this address");
    if (!result)
      throw Error(ErrorCode::kIo, "server " + url + ": " + httplib::to_string(result.error()) +
                                      ": expected an answer");
    return from_httplib(*result);
  }

  const std::string url;
  SocketHandle socket;
  httplib::Client http;
};

HttpClient::HttpClient(const ClientOptions& options) {
  check_url(options.url);
  impl_ = std::make_unique<Impl>(options);
}
HttpClient::~HttpClient() = default;

ClientResponse HttpClient::get(const std::string& path, const HeaderMap& headers) {
  return impl_->check(impl_->http.Get(path, to_httplib(headers)));
}

ClientResponse HttpClient::head(const std::string& path, const HeaderMap& headers) {
  return impl_->check(impl_->http.Head(path, to_httplib(headers)));
}

namespace {

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

}  // namespace

ClientResponse HttpClient::send(const std::string& method, const std::string& path,
                                const std::string& body, const HeaderMap& headers) {
  return impl_->check(impl_->http.send(request_of(method, path, body, headers)));
}

int HttpClient::send_for_status(const std::string& method, const std::string& path,
                                const std::string& body, const HeaderMap& headers) {
  httplib::Request request = request_of(method, path, body, headers);
  int status = 0;
  request.response_handler = [&](const httplib::Response& response) {
    status = response.status;
    return false;  // closes the connection
  };
  const auto result = impl_->http.send(request);
  return status != 0 ? status : impl_->check(result).status;
}

void HttpClient::stop() { impl_->socket.shut_down(); }

uint64_t HttpClient::received() const { return impl_->socket.received(); }

ClientResponse HttpClient::upload(const std::string& path, uint64_t size, const Source& source,
                                  const HeaderMap& headers) {
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
  const auto result = impl_->http.Put(path, to_httplib(headers), static_cast<size_t>(size),
                                      provider, "application/octet-stream");
  if (failure) std::rethrow_exception(failure);
  return impl_->check(result);
}

ClientResponse HttpClient::stream(const std::string& path, const HeaderMap& headers,
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
  const auto result = impl_->http.Get(
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
  if (!closed) head = impl_->check(result);
  if (!error_body.empty()) head.body = error_body;
  return head;
}

bool supports_https() {
#ifdef CPPHTTPLIB_OPENSSL_SUPPORT
  return true;
#else
  return false;
#endif
}

ErrorCode error_code_of(const std::string& name, int http_status) {
  if (const auto code = error_code_named(name)) return *code;
  return http_status >= 500 ? ErrorCode::kIo : ErrorCode::kInvalidInput;
}

void throw_if_problem(const ClientResponse& response) {
  if (response.status < 400) return;
  const auto json = try_parse_json<nlohmann::json>(response.body);
  std::string code,
      detail = "the server answered with status " + std::to_string(response.status) +
               " and no description of the error, expected one as a voxdag service sends it";
  // Returns the member `name`, or the argument `otherwise` if this member is not a string. The
  // answer can come from another server or a proxy, so its JSON can have any form.
  const auto text = [&](const char* name, const std::string& otherwise) {
    const auto found = json.find(name);
    return found != json.end() && found->is_string() ? found->get<std::string>() : otherwise;
  };
  if (json.is_object()) {
    code = text("code", "");
    detail = text("detail", detail);
    if (error_code_of(code, response.status) == ErrorCode::kInvalidInput && code != "invalid_input")
      detail += " (" + code + ")";
  }
  throw Error(error_code_of(code, response.status), detail);
}

}  // namespace voxdag::client
