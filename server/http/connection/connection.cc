#include "server/http/connection/connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr size_t kBufferBytes = 16384;
constexpr double kLinger_s = 1;
constexpr size_t kLingerBytes = 1 << 20;
// A longer pause between two writes was the handler's: the client's time starts again.
constexpr double kHandlerPause_s = 0.2;

}  // namespace

Connection::Connection(int socket, std::string address, const HttpLimits& limits, TlsSession tls)
    : socket_(socket),
      address_(std::move(address)),
      limits_(limits),
      tls_(std::move(tls)),
      buffer_(kBufferBytes),
      phase_start_s_(wall_seconds()) {}

bool Connection::handshake() {
  for (;;) {
    const ssize_t done = tls_.handshake();
    if (done == 1) return true;
    if (!wait_for_io(done, phase_start_s_ + limits_.header_timeout_s)) return false;
  }
}

bool Connection::wait_for_request() {
  phase_ = Phase::kWaiting;
  phase_start_s_ = wall_seconds();
  if (begin_ == end_ && !fill()) return false;
  phase_ = Phase::kHeader;
  phase_start_s_ = wall_seconds();
  consumed_ = 0;
  return true;
}

void Connection::begin_exchange() {
  phase_ = Phase::kExchange;
  phase_start_s_ = wall_seconds();
  consumed_ = 0;
  written_ = 0;
  answer_start_s_ = 0;
}

double Connection::read_deadline() const {
  switch (phase_) {
    case Phase::kWaiting:
      return phase_start_s_ + limits_.idle_timeout_s;
    case Phase::kHeader:
      return phase_start_s_ + limits_.header_timeout_s;
    case Phase::kExchange:
      break;
  }
  return phase_start_s_ + limits_.grace_s +
         static_cast<double>(consumed_) / limits_.min_bytes_per_s;
}

bool Connection::wait_for_io(ssize_t outcome, double deadline_s) {
  const bool reads = outcome == TlsSession::kNeedsRead;
  if (!reads && outcome != TlsSession::kNeedsWrite) {
    error_ = ErrorState::kBroken;
    return false;
  }
  for (;;) {
    const double left_s = deadline_s - wall_seconds();
    if (left_s <= 0) {
      error_ = ErrorState::kTooSlow;
      return false;
    }
    pollfd waiting{socket_, static_cast<short>(reads ? POLLIN : POLLOUT), 0};
    const int ready = poll(&waiting, 1, static_cast<int>(std::min(left_s, 3600.0) * 1000) + 1);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) {
      error_ = ErrorState::kBroken;
      return false;
    }
  }
}

bool Connection::fill() {
  for (;;) {
    const ssize_t got = tls_.read(socket_, buffer_.data(), buffer_.size());
    if (got > 0) {
      begin_ = 0;
      end_ = static_cast<size_t>(got);
      return true;
    }
    if (!wait_for_io(got, read_deadline())) return false;
  }
}

ssize_t Connection::read(char* data, size_t size) {
  if (error_ != ErrorState::kNone) return -1;
  if (begin_ == end_ && !fill()) return -1;
  const size_t taken = std::min(size, end_ - begin_);
  std::memcpy(data, buffer_.data() + begin_, taken);
  begin_ += taken;
  consumed_ += taken;
  if (phase_ == Phase::kHeader && consumed_ > limits_.max_header_bytes) {
    error_ = ErrorState::kHeaderTooLarge;
    return -1;
  }
  return static_cast<ssize_t>(taken);
}

ssize_t Connection::write(const char* data, size_t size) {
  const double now = wall_seconds();
  if (answer_start_s_ == 0 || now - last_write_s_ > kHandlerPause_s) {
    answer_start_s_ = now;
    written_ = 0;
  }
  size_t sent = 0;
  while (sent < size) {
    if (error_ == ErrorState::kBroken) return -1;
    const ssize_t wrote = tls_.write(socket_, data + sent, size - sent);
    if (wrote > 0) {
      sent += static_cast<size_t>(wrote);
      written_ += static_cast<size_t>(wrote);
      continue;
    }
    const double allowed_s =
        limits_.grace_s + static_cast<double>(written_) / limits_.min_bytes_per_s;
    if (!wait_for_io(wrote, answer_start_s_ + allowed_s)) return -1;
  }
  last_write_s_ = wall_seconds();
  return static_cast<ssize_t>(size);
}

bool Connection::peer_disconnected() const {
  char byte;
  const ssize_t got = recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return got == 0 || (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

void Connection::linger() {
  tls_.shutdown();
  if (shutdown(socket_, SHUT_WR) != 0) return;
  const double deadline = wall_seconds() + kLinger_s;
  for (size_t bytes = 0; bytes < kLingerBytes;) {
    pollfd waiting{socket_, POLLIN, 0};
    const double left_s = deadline - wall_seconds();
    if (left_s <= 0 || poll(&waiting, 1, static_cast<int>(left_s * 1000) + 1) <= 0) return;
    const ssize_t got = recv(socket_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (got <= 0) return;
    bytes += static_cast<size_t>(got);
  }
}

void Connection::get_remote_ip_and_port(std::string& ip, int& port) const {
  ip = address_;
  port = 0;
}

void Connection::get_local_ip_and_port(std::string& ip, int& port) const {
  ip.clear();
  port = 0;
}

}  // namespace voxdag::server
