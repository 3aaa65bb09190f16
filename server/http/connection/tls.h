// TLS with certificate files, over non-blocking sockets.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <memory>
#include <string>

struct ssl_ctx_st;
struct ssl_st;

namespace voxdag::server {

// The TLS state of one connection. A default-constructed session passes bytes unencrypted. read()
// and write() return the number of transferred bytes, 0 at the end of the stream, or one of the
// negative constants below. Used by one thread.
class TlsSession {
 public:
  static constexpr ssize_t kNeedsRead = -1, kNeedsWrite = -2, kBroken = -3;

  TlsSession() = default;
  // Returns 1 when the handshake is complete, else the same values as read().
  ssize_t handshake();
  ssize_t read(int socket, char* data, size_t size);
  ssize_t write(int socket, const char* data, size_t size);
  // Tells the client that nothing more will be sent.
  void shutdown();

 private:
  friend class TlsContext;
  struct Free {
    void operator()(ssl_st* session) const;
  };
  ssize_t outcome(int result);

  std::unique_ptr<ssl_st, Free> ssl_;
};

class TlsContext {
 public:
  // PEM files: the chain beginning with the server's certificate, and its key. Throws
  // Error{kInvalidInput} if they cannot be read or do not match. Makes the process ignore SIGPIPE.
  TlsContext(const std::string& certificate_file, const std::string& key_file);
  TlsSession session(int socket) const;

 private:
  struct Free {
    void operator()(ssl_ctx_st* context) const;
  };
  std::unique_ptr<ssl_ctx_st, Free> context_;
};

}  // namespace voxdag::server
