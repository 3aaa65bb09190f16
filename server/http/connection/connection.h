// One client's connection as httplib reads and writes it: a plain or TLS socket on which no call
// blocks for longer than the phase allows. Used by one thread.
//
// Phases: waiting (idle_timeout_s for the next request), header (header_timeout_s and
// max_header_bytes for all of it), exchange (grace_s + bytes / min_bytes_per_s for the body, and
// the same for the answer). A client that exceeds them puts the connection into an error state, and
// reads fail from then on.
#pragma once

#include <httplib.h>

#include <memory>
#include <string>
#include <vector>

#include "server/http/connection/tls.h"
#include "server/http/limits.h"

namespace voxdag::server {

class Connection : public httplib::Stream {
 public:
  // Owns neither the socket, which must be non-blocking, nor the limits.
  Connection(int socket, std::string address, const HttpLimits& limits, TlsSession tls);

  // The TLS handshake; false if it fails.
  bool handshake();
  // Waits for the first byte of a request; false if none comes.
  bool wait_for_request();
  void begin_exchange();
  // Bytes of the request body read so far.
  uint64_t body_bytes() const { return consumed_; }

  enum class ErrorState { kNone, kBroken, kTooSlow, kHeaderTooLarge };
  ErrorState error_state() const { return error_; }
  // Whether the client has closed the connection. Consumes no bytes.
  bool peer_disconnected() const;
  // Closes the sending side and discards what the client still sends for up to a second, so that
  // the last answer is not lost to a reset.
  void linger();

  bool is_readable() const override { return error_ == ErrorState::kNone; }
  bool is_writable() const override { return error_ == ErrorState::kNone; }
  ssize_t read(char* data, size_t size) override;
  ssize_t write(const char* data, size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  // httplib only checks that the number is in the range of select(), which is not used here.
  socket_t socket() const override { return 0; }

 private:
  enum class Phase { kWaiting, kHeader, kExchange };

  bool fill();
  double read_deadline() const;
  // Waits until the socket is ready for what a call on tls_ needs (its `outcome`). False, with the
  // error state set, if the outcome is an error or the deadline passes.
  bool wait_for_io(ssize_t outcome, double deadline_s);

  const int socket_;
  const std::string address_;
  const HttpLimits& limits_;
  TlsSession tls_;
  Phase phase_ = Phase::kHeader;
  ErrorState error_ = ErrorState::kNone;
  std::vector<char> buffer_;
  size_t begin_ = 0, end_ = 0;  // the bytes of the buffer that are not yet read
  double phase_start_s_ = 0;
  uint64_t consumed_ = 0;  // in this phase
  double answer_start_s_ = 0, last_write_s_ = 0;
  uint64_t written_ = 0;
};

}  // namespace voxdag::server
