// TLS by certificate files, over sockets that do not block.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <memory>
#include <string>

struct ssl_ctx_st;
struct ssl_st;

namespace voxdag::server {

// One connection's; an empty one passes bytes as they are. What read() and write() return: bytes
// moved, 0 at the end of the stream, or one of the below.
class TlsSession {
 public:
  static constexpr ssize_t kWantsRead = -1, kWantsWrite = -2, kBroken = -3;

  TlsSession() = default;
  // 1 when done.
  ssize_t greet();
  ssize_t read(int socket, char* data, size_t size);
  ssize_t write(int socket, const char* data, size_t size);
  void say_goodbye();

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
  // Error{kInvalidInput} if they cannot be read or do not belong together.
  TlsContext(const std::string& certificate_file, const std::string& key_file);
  TlsSession session(int socket) const;

 private:
  struct Free {
    void operator()(ssl_ctx_st* context) const;
  };
  std::unique_ptr<ssl_ctx_st, Free> context_;
};

}  // namespace voxdag::server
