// One client's connection as httplib reads and writes it: a socket that never blocks for longer
// than its phase allows, plain or TLS.
//
// Phases: waiting (idle_s for the next request), header (header_s and header_bytes for all of it),
// exchange (grace_s + bytes / min_bytes_per_s for the body, the same for the answer). What comes
// too late or grows too large breaks the connection; problem() says why. Used by one thread.
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
  // Takes over neither the socket, which is set not to block, nor the limits.
  Connection(int socket, std::string address, const HttpLimits& limits, TlsSession tls);

  // The handshake of TLS; false if it fails.
  bool greet();
  // Waits for the first byte of a request; false if none comes.
  bool wait_for_request();
  void begin_exchange();
  // Bytes of this exchange's body that were read so far.
  uint64_t body_bytes() const { return consumed_; }

  enum class Trouble { kNone, kBroken, kTooSlow, kHeaderTooLarge };
  Trouble trouble() const { return trouble_; }
  // The client hung up. Looks without reading.
  bool peer_gone() const;
  // Says that nothing more will be sent, and reads for a moment what the client still sends, so
  // that the last answer is not lost to a reset.
  void linger();

  bool is_readable() const override { return trouble_ == Trouble::kNone; }
  bool is_writable() const override { return trouble_ == Trouble::kNone; }
  ssize_t read(char* data, size_t size) override;
  ssize_t write(const char* data, size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  // httplib asks only whether it is one that select() can take: it need not.
  socket_t socket() const override { return 0; }

 private:
  enum class Phase { kWaiting, kHeader, kExchange };

  bool fill();
  double read_deadline() const;
  // Polls for `events` until the deadline. False, and in trouble, if it passes.
  bool wait(short events, double deadline_s);

  const int socket_;
  const std::string address_;
  const HttpLimits& limits_;
  TlsSession tls_;
  Phase phase_ = Phase::kHeader;
  Trouble trouble_ = Trouble::kNone;
  std::vector<char> buffer_;
  size_t begin_ = 0, end_ = 0;  // what of the buffer was received and not yet read
  double phase_start_s_ = 0;
  uint64_t consumed_ = 0;  // in this phase
  double answer_start_s_ = 0, last_write_s_ = 0;
  uint64_t written_ = 0;
};

}  // namespace voxdag::server
