#include "server/http/connection/listener.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <memory>
#include <thread>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "server/http/connection/connection_table.h"

namespace voxdag::server {
namespace {

constexpr int kBacklog = 512;
// Kernel memory per connection for bytes that the client has not received yet. The kernel doubles
// this value for its bookkeeping.
constexpr int kSendBufferBytes = 128 << 10;
constexpr int kMaxSegmentBytes = 8960;  // Ethernet with jumbo frames

struct FreeAddresses {
  void operator()(addrinfo* list) const { freeaddrinfo(list); }
};
using Addresses = std::unique_ptr<addrinfo, FreeAddresses>;

Addresses resolve(const std::string& address, int port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* list = nullptr;
  const int failure = getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &list);
  if (failure != 0 || !list)
    throw Error(ErrorCode::kInvalidInput,
                "cannot listen on '" + address + "' (" +
                    (failure != 0 ? gai_strerror(failure) : "it has no address") +
                    "): expected an address of this machine");
  return Addresses(list);
}

std::string numeric(const sockaddr* address, socklen_t size) {
  char text[NI_MAXHOST];
  if (getnameinfo(address, size, text, sizeof text, nullptr, 0, NI_NUMERICHOST) != 0) return "?";
  return text;
}

int bound_port(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  char port[NI_MAXSERV];
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (getsockname(socket, generic, &size) != 0 ||
      getnameinfo(generic, size, nullptr, 0, port, sizeof port, NI_NUMERICSERV) != 0)
    return 0;
  return std::stoi(port);
}

}  // namespace

Listener::Listener(const std::string& address, int port) {
  const Addresses found = resolve(address, port);
  const auto refuse = [&](int failure) {
    const std::string reason = errno_text(failure);
    if (socket_ >= 0) close(socket_);
    throw Error(ErrorCode::kIo, "cannot listen on " + address + " port " + std::to_string(port) +
                                    " (" + reason +
                                    "): expected an address of this machine, and a free port that "
                                    "this user may use");
  };
  socket_ = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket_ < 0) refuse(errno);
  const int yes = 1;
  // Allows the use of a port whose old connections are still closing, but not of a port on which
  // another socket listens.
  setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  // Without this limit, segments over the loopback interface have 64 KiB. The kernel chooses the
  // size of the buffers of both ends by the segment size, so the buffers of a connection would have
  // several MB.
  setsockopt(socket_, IPPROTO_TCP, TCP_MAXSEG, &kMaxSegmentBytes, sizeof kMaxSegmentBytes);
  if (bind(socket_, found->ai_addr, found->ai_addrlen) != 0 || ::listen(socket_, kBacklog) != 0 ||
      pipe2(wake_, O_CLOEXEC | O_NONBLOCK) != 0)
    refuse(errno);
  port_ = bound_port(socket_);
}

Listener::~Listener() {
  close(socket_);
  close(wake_[0]);
  close(wake_[1]);
}

void Listener::accept_all(const std::function<void(int, const std::string&)>& on_connection) {
  for (;;) {
    pollfd waiting[2] = {{socket_, POLLIN, 0}, {wake_[0], POLLIN, 0}};
    if (poll(waiting, 2, -1) < 0 && errno != EINTR) return;
    if (waiting[1].revents) return;
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    const int client = accept4(socket_, generic, &size, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (client < 0) {
      // File descriptors or memory are used up. The client waits in the backlog until they are free
      // again.
      if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      continue;
    }
    const int yes = 1;
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    setsockopt(client, SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
    on_connection(client, numeric(generic, size));
  }
}

void Listener::stop() {
  const char byte = 0;
  [[maybe_unused]] const ssize_t wrote = write(wake_[1], &byte, 1);
}

bool is_loopback_name(const std::string& address) {
  const Addresses found = resolve(address, 0);
  for (const addrinfo* at = found.get(); at; at = at->ai_next)
    if (!is_loopback(numeric(at->ai_addr, at->ai_addrlen))) return false;
  return true;
}

}  // namespace voxdag::server
