// A listening TCP socket. It is closed on exec, and errors of accept() do not stop it.
#pragma once

#include <functional>
#include <string>

namespace voxdag::server {

class Listener {
 public:
  // Listens on an address ("127.0.0.1", "::1", "0.0.0.0", a name) and port (0: any free port).
  // Throws Error{kInvalidInput} if the address does not belong to this machine, Error{kIo} if the
  // port is in use.
  Listener(const std::string& address, int port);
  ~Listener();
  Listener(const Listener&) = delete;

  int port() const { return port_; }
  // Calls on_connection(socket, client address) for every connection; the socket is non-blocking
  // and belongs to the callee. Returns after stop().
  void accept_all(const std::function<void(int socket, const std::string& address)>& on_connection);
  // Ends accept_all(). May be called from any thread and repeatedly. Connections not yet accepted
  // are refused.
  void stop();

 private:
  int socket_ = -1;
  int wake_[2] = {-1, -1};  // a pipe; a byte in it ends accept_all()
  int port_ = 0;
};

// True if the address is reachable only from this machine.
bool is_loopback_name(const std::string& address);

}  // namespace voxdag::server
