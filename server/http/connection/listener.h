// A listening TCP socket that is closed on exec and survives whatever accept() reports.
#pragma once

#include <functional>
#include <string>

namespace voxdag::server {

class Listener {
 public:
  // Listens on an address ("127.0.0.1", "::1", "0.0.0.0", a name) and port, 0 for any free one.
  // Throws Error{kInvalidInput} for an address that is none of this machine, Error{kIo} if the port
  // is taken.
  Listener(const std::string& address, int port);
  ~Listener();
  Listener(const Listener&) = delete;

  int port() const { return port_; }
  // Hands every connection (a socket that does not block, the client's address) to `use`, which
  // owns it then. Returns after stop().
  void accept_all(const std::function<void(int socket, const std::string& address)>& use);
  // From any thread, once or often. Connections that nobody has taken yet are refused.
  void stop();

 private:
  int socket_ = -1;
  int wake_[2] = {-1, -1};  // a pipe: a byte in it ends accept_all()
  int port_ = 0;
};

// The address is only reachable from this machine.
bool is_loopback_name(const std::string& address);

}  // namespace voxdag::server
