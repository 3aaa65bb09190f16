#include "server/http/connection/connection_table.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/base/clock.h"
#include "core/base/process_limits.h"

namespace voxdag::server {
namespace {

// A client that sends a body or receives an answer counts as active until it has been idle for this
// time.
constexpr double kMinExchangeWaitS = 0.25;
constexpr std::chrono::seconds kMaxEvictionWait{1};
// Interval at which an answer that waits for memory looks for connections to close.
constexpr std::chrono::milliseconds kReleaseWait{20};
// Freed memory is returned to the system after this many bytes of answers.
constexpr size_t kTrimIntervalBytes = 32 << 20;

}  // namespace

bool is_loopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1" || address.starts_with("::ffff:127.");
}

std::string client_of(const std::string& address) {
  in6_addr parsed{};
  // Removes the percent sign and the name of the network interface that end a link-local address,
  // because inet_pton() does not accept them.
  if (inet_pton(AF_INET6, address.substr(0, address.find('%')).c_str(), &parsed) != 1)
    return address;
  char text[INET6_ADDRSTRLEN];
  if (IN6_IS_ADDR_V4MAPPED(&parsed))
    return inet_ntop(AF_INET, parsed.s6_addr + 12, text, sizeof text);
  std::fill(parsed.s6_addr + 8, parsed.s6_addr + 16, uint8_t{0});
  return std::string(inet_ntop(AF_INET6, &parsed, text, sizeof text)) + "/64";
}

bool ConnectionTable::admit(int socket, const std::string& address, Place& place) {
  const std::string client = client_of(address);
  const bool is_exempt = is_loopback(address);
  std::unique_lock lock(mutex_);
  const auto same = by_client_.find(client);
  if (same != by_client_.end() && same->second >= limits_.max_per_client && !is_exempt)
    return false;
  // The table can have more entries than open connections, because an evicted connection remains in
  // the table until its thread has ended.
  const size_t max_entries = limits_.max_connections + limits_.max_connections / 4 + 1;
  if (!removed_.wait_for(lock, kMaxEvictionWait, [&] { return entries_.size() < max_entries; }) ||
      (entries_.size() >= limits_.max_connections && !evict_one()))
    return false;
  place = entries_.insert(entries_.end(), Entry{socket, client, is_exempt, Waiting::kForRequest,
                                                wall_seconds(), false});
  ++by_client_[client];
  return true;
}

// Closes the connection that has waited longest. Returns false if no connection may be closed.
// Later, the thread of the closed connection finds the end of the stream and removes its entry.
// Until then, the table has this entry and the entry of the new connection.
bool ConnectionTable::evict_one() {
  return evict_longest([](const Entry&) { return true; });
}

template <class IsCandidate>
bool ConnectionTable::evict_longest(const IsCandidate& is_candidate) {
  const double now = wall_seconds();
  Entry* longest = nullptr;
  for (Entry& entry : entries_) {
    const bool may_be_closed =
        entry.waiting != Waiting::kNot && !entry.evicted && is_candidate(entry) &&
        (entry.waiting != Waiting::kInExchange || now - entry.waiting_since_s >= kMinExchangeWaitS);
    if (may_be_closed && (!longest || entry.waiting_since_s < longest->waiting_since_s))
      longest = &entry;
  }
  if (!longest) return false;
  longest->evicted = true;
  shutdown(longest->socket, SHUT_RDWR);
  return true;
}

void ConnectionTable::set_waiting(Place place, double since_s, Waiting waiting) {
  std::lock_guard lock(mutex_);
  place->waiting = waiting;
  place->waiting_since_s = since_s;
}

void ConnectionTable::set_working(Place place) {
  std::lock_guard lock(mutex_);
  place->waiting = Waiting::kNot;
}

void ConnectionTable::remove(Place place) {
  std::lock_guard lock(mutex_);
  const auto count = by_client_.find(place->client);
  if (--count->second == 0) by_client_.erase(count);
  entries_.erase(place);
  removed_.notify_all();
  released_.notify_all();
}

template <class Counts>
size_t ConnectionTable::answer_bytes(const Counts& counts) const {
  size_t bytes = 0;
  for (const Entry& entry : entries_)
    if (counts(entry)) bytes += entry.answer_bytes;
  return bytes;
}

// Returns true if the limits allow the answer now. Otherwise closes the connection whose answer has
// waited longest, unless the connections that were closed before will release enough memory.
bool ConnectionTable::make_room_for_answer(const Entry& entry, size_t bytes) {
  const auto fits = [&](size_t limit, const auto& counts) {
    const size_t used = answer_bytes(counts);
    if (used + bytes <= limit) return true;
    const size_t leaving =
        answer_bytes([&](const Entry& other) { return counts(other) && other.evicted; });
    if (used - leaving + bytes > limit)
      evict_longest([&](const Entry& other) { return counts(other) && other.answer_bytes > 0; });
    return false;
  };
  const auto same_client = [&](const Entry& other) { return other.client == entry.client; };
  if (!entry.is_exempt && !fits(kMaxAnswerBytesPerClient, same_client)) return false;
  return fits(kMaxAnswerBytes, [](const Entry&) { return true; });
}

bool ConnectionTable::reserve_answer(Place place, size_t bytes) {
  if (bytes > (place->is_exempt ? kMaxAnswerBytes : kMaxAnswerBytesPerClient)) return false;
  const auto deadline = std::chrono::steady_clock::now() + kMaxEvictionWait;
  std::unique_lock lock(mutex_);
  while (!make_room_for_answer(*place, bytes)) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    released_.wait_for(lock, kReleaseWait);
  }
  place->answer_bytes = bytes;
  return true;
}

void ConnectionTable::release_answer(Place place) {
  bool trims = false;
  {
    std::lock_guard lock(mutex_);
    bytes_since_trim_ += std::exchange(place->answer_bytes, 0);
    trims = bytes_since_trim_ >= kTrimIntervalBytes;
    if (trims) bytes_since_trim_ = 0;
  }
  released_.notify_all();
  if (trims) trim_heap();
}

size_t ConnectionTable::size() const {
  std::lock_guard lock(mutex_);
  return entries_.size();
}

void ConnectionTable::close_waiting() {
  std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_)
    if (entry.waiting == Waiting::kForRequest) shutdown(entry.socket, SHUT_RD);
}

void ConnectionTable::close_all() {
  std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_) shutdown(entry.socket, SHUT_RDWR);
}

}  // namespace voxdag::server
