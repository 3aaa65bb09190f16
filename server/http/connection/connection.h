// One client's connection: a plain or TLS socket on which no call blocks for longer than the phase
// allows. Used by one thread.
//
// Phases: waiting (idle_timeout_s for the next request), header (header_timeout_s for all of it),
// exchange (the body and the answer each at min_bytes_per_s, at no time more than grace_s behind).
// Only the time in which the connection waits for its client counts. A client that exceeds it puts
// the connection into an error state, and reads fail from then on. While it waits, the table knows
// so and may close the connection in favor of another one.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/connection/connection_table.h"
#include "server/http/connection/limits.h"
#include "server/http/connection/tls.h"

namespace voxdag::server {

class Connection {
 public:
  // Owns none of its parts. The socket must be non-blocking; `place` is its own in the table.
  Connection(int socket, const HttpLimits& limits, TlsSession tls, ConnectionTable& table,
             ConnectionTable::Place place);

  // The TLS handshake; false if it fails.
  bool handshake();
  // Waits for the first byte of a request; false if none comes.
  bool wait_for_request();
  // Ends the header's phase.
  void begin_exchange();

  enum class ErrorState { kNone, kBroken, kTooSlow };
  ErrorState error_state() const { return error_; }
  // Lets the kernel choose the size of the send buffer, which is small otherwise: for long answers
  // over long distances.
  void allow_large_send_buffer();
  // True if the client has closed the connection. Consumes no bytes.
  bool peer_disconnected() const;
  // Closes the sending side and discards further bytes of the client for up to a second, so that
  // a reset does not destroy the last answer.
  void linger();

  // The next bytes, at least one unless in an error state; valid until the next call.
  std::string_view read(uint64_t max_bytes);
  // Appends the bytes up to and including the next LF. False if `text` would become longer than
  // `max_bytes`, or in an error state.
  bool read_line(std::string& text, size_t max_bytes);
  // Sends all of it; false if that fails.
  bool write(std::string_view bytes);

 private:
  enum class Phase { kWaiting, kHeader, kExchange };
  // The wait for the client in this phase beyond the time of its bytes at a rate: the minimum rate,
  // and a multiple that protects the connection from eviction.
  struct Pace {
    double behind_minimum_s = 0;
    double behind_steady_s = 0;
  };

  bool fill();
  // Waits until the socket is ready for the repeated call on tls_ (`outcome` is its result). False,
  // with the error state set, if the outcome is an error or the client exceeds its time.
  bool wait_for_io(ssize_t outcome, Pace& pace);
  double max_wait_s() const;
  void count(uint64_t bytes, Pace& pace) const;

  const int socket_;
  const HttpLimits& limits_;
  TlsSession tls_;
  ConnectionTable& table_;
  const ConnectionTable::Place place_;
  Phase phase_ = Phase::kHeader;
  ErrorState error_ = ErrorState::kNone;
  std::vector<char> buffer_;
  size_t begin_ = 0, end_ = 0;  // the bytes of the buffer that are not yet read
  Pace reading_, writing_;
};

}  // namespace voxdag::server
