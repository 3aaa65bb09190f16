// Sends the input to an HTTP server through a real connection. The server answers with HTTP or
// closes the connection, and continues to accept connections.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>

#include "server/http/http_server.h"
#include "tests/fuzz/support/fuzz_target.h"

namespace voxdag::server {
namespace {

constexpr int kMaxWaits = 20;

// Answers every request with its method, its path, and the part of its body that can be read.
Response echo(Request& request) {
  std::string body = request.method + " " + request.target.path + "\n";
  if (request.read_body)
    request.read_body([&](std::string_view piece) {
      body += piece;
      return body.size() < 65536;
    });
  return make_response(200, "text/plain", "no-store", body);
}

class EchoServer {
 public:
  EchoServer() : server_(options(), echo), thread_([this] { server_.run(0); }) {}
  ~EchoServer() {
    server_.stop();
    thread_.join();
  }
  int port() const { return server_.port(); }

 private:
  static HttpOptions options() {
    HttpOptions options;
    options.port = 0;
    options.limits.max_header_bytes = 4096;
    return options;
  }

  HttpServer server_;
  std::thread thread_;
};

// Returns a different loopback address in each call. One address does not have enough ports,
// because the port of a closed connection is unavailable for a minute.
sockaddr_in next_loopback_address() {
  static uint32_t count = 0;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK + 256 + count++ % 65536);
  return address;
}

// Returns false after twenty polls of one second without data. There are many short polls, because
// a pause of the machine then uses up only one of them and is not reported as a finding.
bool has_something_to_read(int fd) {
  for (int i = 0; i < kMaxWaits; ++i) {
    pollfd waiting{fd, POLLIN, 0};
    if (::poll(&waiting, 1, 1000) == 1) return true;
  }
  return false;
}

std::string exchange(int port, const uint8_t* data, size_t size) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<uint16_t>(port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const sockaddr_in from = next_loopback_address();
  fuzz::require(fd >= 0 && ::bind(fd, reinterpret_cast<const sockaddr*>(&from), sizeof from) == 0,
                "the loopback has a free port");
  fuzz::require(::connect(fd, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0,
                "the service accepts connections");
  // The loop ends early if the server closes the connection before it has read all bytes.
  for (size_t sent = 0; sent < size;) {
    const ssize_t n = ::send(fd, data + sent, size - sent, MSG_NOSIGNAL);
    if (n <= 0) break;
    sent += static_cast<size_t>(n);
  }
  ::shutdown(fd, SHUT_WR);
  std::string answer;
  for (char buffer[4096];;) {
    fuzz::require(has_something_to_read(fd),
                  "the service ends an exchange with a client that sends no more");
    const ssize_t n = ::recv(fd, buffer, sizeof buffer, 0);
    if (n <= 0) break;
    answer.append(buffer, static_cast<size_t>(n));
  }
  ::close(fd);
  return answer;
}

}  // namespace
}  // namespace voxdag::server

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  static server::EchoServer service;
  const std::string answer = server::exchange(service.port(), data, size);
  fuzz::require(answer.empty() || answer.starts_with("HTTP/1.1 "), "an answer is HTTP/1.1");
  return 0;
}
