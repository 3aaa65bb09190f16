// One client's connection: a plain or TLS socket. A phase of the connection limits how long calls
// may block. Used by one thread.
//
// Phases:
//   - waiting: the next request must begin within idle_timeout_s
//   - header: the header must be complete within header_timeout_s
//   - exchange: the client must send the body, and receive the answer, at min_bytes_per_s or
//     faster. The client may be up to grace_s behind this rate. Only the content of the body counts
//     as progress, not the lines around its chunks
//
// Only the time in which the connection waits for its client counts, except after limit_request().
// If a client exceeds its time, the connection enters an error state, in which reads fail. While a
// connection waits for its client, the table may close it in favor of a new connection.
#pragma once

#include <cmath>
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
  // The socket must be non-blocking; this object does not close it. `limits` and `table` must
  // outlive this object. `place` is the connection's place in the table.
  Connection(int socket, const HttpLimits& limits, TlsSession tls, ConnectionTable& table,
             ConnectionTable::Place place);

  // Performs the TLS handshake. Returns false if it fails.
  bool handshake();
  // Waits for the first byte of a request. Returns false if none arrives.
  bool wait_for_request();
  // Ends the header phase; the exchange phase begins.
  void begin_exchange();
  // Limits the time for the rest of this request to grace_s from now, however fast the client
  // sends. Use it for requests with a short body. Until the body is read, the table may close the
  // connection like a connection whose header is incomplete.
  void limit_request();

  enum class ErrorState { kNone, kBroken, kTooSlow };
  ErrorState error_state() const { return error_; }
  // Reserves memory for an answer, or frees it (ConnectionTable::reserve_answer).
  bool reserve_answer(size_t bytes) { return table_.reserve_answer(place_, bytes); }
  void release_answer() { table_.release_answer(place_); }
  // Lets the kernel choose the size of the send buffer, for long answers over long distances.
  // Without this call the buffer is small.
  void allow_large_send_buffer();
  // True if the client has closed the connection. Consumes no bytes.
  bool peer_disconnected() const;
  // Closes the sending side, then discards the client's bytes for up to a second. If the socket
  // were closed with unread bytes, the kernel would send a reset, which could destroy the last
  // answer.
  void linger();
  // Makes linger() do nothing, because the client may send without end.
  void close_without_linger() { lingers_ = false; }

  // Returns the next bytes: at least one byte, or none in an error state. The result is valid until
  // the next call.
  std::string_view read(uint64_t max_bytes);
  // Appends the bytes up to and including the next LF. Returns false in an error state, or if
  // `text` would become longer than `max_bytes`. The bytes do not count as progress of a body.
  bool read_line(std::string& text, size_t max_bytes);
  // Sends all bytes. Returns false if this fails.
  bool write(std::string_view bytes);

 private:
  enum class Phase { kWaiting, kHeader, kExchange };
  // Time spent waiting for the client in this phase, minus the time that the transferred bytes take
  // at a given rate. `behind_minimum_s` uses the minimum rate. `behind_steady_s` uses the *steady
  // rate*, a multiple of the minimum rate. A client that is faster than the steady rate is not
  // evicted.
  struct Pace {
    double behind_minimum_s = 0;
    double behind_steady_s = 0;
  };

  bool fill();
  // Waits until the socket is ready for repeating the call on tls_ that returned `outcome`. Returns
  // false and sets the error state if `outcome` is an error or the client exceeds its time.
  bool wait_for_io(ssize_t outcome, Pace& pace);
  double max_wait_s() const;
  bool has_short_body(const Pace& pace) const;
  void count(uint64_t bytes, Pace& pace) const;

  const int socket_;
  const HttpLimits& limits_;
  TlsSession tls_;
  ConnectionTable& table_;
  const ConnectionTable::Place place_;
  Phase phase_ = Phase::kHeader;
  ErrorState error_ = ErrorState::kNone;
  bool lingers_ = true;
  std::vector<char> buffer_;
  size_t begin_ = 0, end_ = 0;  // unread bytes of the buffer
  Pace reading_, writing_;
  // Begin and end of the time for the rest of a request with a short body, in wall_seconds().
  double request_begin_s_ = 0, request_end_s_ = HUGE_VAL;
};

}  // namespace voxdag::server
