#include "server/http/connection/connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr size_t kBufferBytes = 16384;
constexpr double kLingerS = 1;
// Maximum bytes that linger() discards. A proxy reads the answer only after it has sent all bytes
// in its buffers. So this number is larger than the buffers of the kernel and of a proxy together.
constexpr size_t kLingerBytes = 16 << 20;
constexpr double kSteadyRates = 8;  // steady rate (struct Pace) in multiples of the minimum rate

}  // namespace

Connection::Connection(int socket, const HttpLimits& limits, TlsSession tls, ConnectionTable& table,
                       ConnectionTable::Place place)
    : socket_(socket),
      limits_(limits),
      tls_(std::move(tls)),
      table_(table),
      place_(place),
      buffer_(kBufferBytes) {}

bool Connection::handshake() {
  for (;;) {
    const ssize_t done = tls_.handshake();
    if (done == 1) return true;
    if (!wait_for_io(done, reading_)) return false;
  }
}

bool Connection::wait_for_request() {
  phase_ = Phase::kWaiting;
  reading_ = {};
  request_end_s_ = HUGE_VAL;
  if (begin_ == end_ && !fill()) return false;
  phase_ = Phase::kHeader;
  reading_ = {};
  return true;
}

void Connection::begin_exchange() {
  phase_ = Phase::kExchange;
  reading_ = writing_ = {};
  table_.set_working(place_);
}

void Connection::limit_request() {
  request_begin_s_ = wall_seconds();
  request_end_s_ = request_begin_s_ + limits_.grace_s;
}

bool Connection::has_short_body(const Pace& pace) const {
  return &pace == &reading_ && request_end_s_ < HUGE_VAL;
}

double Connection::max_wait_s() const {
  switch (phase_) {
    case Phase::kWaiting:
      return limits_.idle_timeout_s;
    case Phase::kHeader:
      return limits_.header_timeout_s;
    case Phase::kExchange:
      break;
  }
  return limits_.grace_s;
}

void Connection::count(uint64_t bytes, Pace& pace) const {
  if (phase_ != Phase::kExchange) return;  // in other phases, bytes do not extend the time
  const double earned_s = static_cast<double>(bytes) / limits_.min_bytes_per_s;
  pace.behind_minimum_s = std::max(0.0, pace.behind_minimum_s - earned_s);
  pace.behind_steady_s = std::max(0.0, pace.behind_steady_s - earned_s / kSteadyRates);
}

bool Connection::wait_for_io(ssize_t outcome, Pace& pace) {
  const bool reads = outcome == TlsSession::kNeedsRead;
  if (!reads && outcome != TlsSession::kNeedsWrite) {
    error_ = ErrorState::kBroken;
    return false;
  }
  const double start = wall_seconds();
  double deadline = start + max_wait_s() - pace.behind_minimum_s;
  if (has_short_body(pace)) {
    deadline = std::min(deadline, request_end_s_);
    table_.set_waiting(place_, request_begin_s_, ConnectionTable::Waiting::kForShortBody);
  } else {
    table_.set_waiting(place_, start - pace.behind_steady_s,
                       phase_ == Phase::kExchange ? ConnectionTable::Waiting::kInExchange
                                                  : ConnectionTable::Waiting::kForRequest);
  }
  bool ready = false, broken = false;
  double now = start;
  for (; !ready && !broken && now < deadline; now = wall_seconds()) {
    pollfd waiting{socket_, static_cast<short>(reads ? POLLIN : POLLOUT), 0};
    const int wait_ms = static_cast<int>(std::min(deadline - now, 3600.0) * 1000) + 1;
    const int count = poll(&waiting, 1, wait_ms);
    ready = count > 0;
    broken = count < 0 && errno != EINTR;
  }
  table_.set_working(place_);
  pace.behind_minimum_s += now - start;
  pace.behind_steady_s += now - start;
  if (!ready) error_ = broken ? ErrorState::kBroken : ErrorState::kTooSlow;
  return ready;
}

bool Connection::fill() {
  if (error_ != ErrorState::kNone) return false;
  if (has_short_body(reading_) && wall_seconds() > request_end_s_) {
    error_ = ErrorState::kTooSlow;
    return false;
  }
  for (;;) {
    const ssize_t got = tls_.read(socket_, buffer_.data(), buffer_.size());
    if (got > 0) {
      begin_ = 0;
      end_ = static_cast<size_t>(got);
      return true;
    }
    if (!wait_for_io(got, reading_)) return false;
  }
}

std::string_view Connection::read(uint64_t max_bytes) {
  if (begin_ == end_ && !fill()) return {};
  const size_t size = std::min<uint64_t>(max_bytes, end_ - begin_);
  const std::string_view bytes(buffer_.data() + begin_, size);
  begin_ += size;
  count(size, reading_);
  return bytes;
}

bool Connection::read_line(std::string& text, size_t max_bytes) {
  for (bool ended = false; !ended;) {
    if (begin_ == end_ && !fill()) return false;
    const std::string_view bytes(buffer_.data() + begin_, end_ - begin_);
    const size_t line_feed = bytes.find('\n');
    ended = line_feed != std::string_view::npos;
    const size_t size = ended ? line_feed + 1 : bytes.size();
    if (size > max_bytes - std::min(max_bytes, text.size())) return false;
    text += bytes.substr(0, size);
    begin_ += size;
  }
  return true;
}

bool Connection::write(std::string_view bytes) {
  while (!bytes.empty()) {
    if (error_ == ErrorState::kBroken) return false;
    const ssize_t wrote = tls_.write(socket_, bytes.data(), bytes.size());
    if (wrote > 0) {
      bytes.remove_prefix(static_cast<size_t>(wrote));
      count(static_cast<size_t>(wrote), writing_);
    } else if (!wait_for_io(wrote, writing_)) {
      return false;
    }
  }
  return true;
}

void Connection::allow_large_send_buffer() {
#ifdef SO_BUF_LOCK  // available from Linux 5.16
  const int none = 0;
  setsockopt(socket_, SOL_SOCKET, SO_BUF_LOCK, &none, sizeof none);
#endif
}

// Uses poll() instead of a read: unread bytes, such as the last bytes of a TLS session, can precede
// the end of the stream, and a read would return them instead of the end.
bool Connection::peer_disconnected() const {
  pollfd peer{socket_, POLLRDHUP, 0};
  return poll(&peer, 1, 0) > 0;
}

void Connection::linger() {
  if (error_ == ErrorState::kBroken || !lingers_) return;
  tls_.shutdown();
  if (shutdown(socket_, SHUT_WR) != 0) return;
  // Counts as waiting since the time 0. So the table closes this connection before any other
  // connection if it needs space for a new connection.
  table_.set_waiting(place_, 0, ConnectionTable::Waiting::kForRequest);
  const double deadline = wall_seconds() + kLingerS;
  for (size_t bytes = 0; bytes < kLingerBytes;) {
    pollfd waiting{socket_, POLLIN, 0};
    const double left_s = deadline - wall_seconds();
    if (left_s <= 0 || poll(&waiting, 1, static_cast<int>(left_s * 1000) + 1) <= 0) return;
    const ssize_t got = recv(socket_, buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    if (got <= 0) return;
    bytes += static_cast<size_t>(got);
  }
}

}  // namespace voxdag::server
