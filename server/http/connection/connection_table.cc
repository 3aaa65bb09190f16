#include "server/http/connection/connection_table.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

// During a body or an answer, a client that has been idle for less than this time counts as active.
constexpr double kMinExchangeWaitS = 0.25;
constexpr std::chrono::seconds kMaxEvictionWait{1};

}  // namespace

bool is_loopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1" || address.starts_with("::ffff:127.");
}

std::string client_of(const std::string& address) {
  in6_addr parsed{};
  // In a link-local address, the name of the network interface follows a percent sign.
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
  std::unique_lock lock(mutex_);
  const auto same = by_client_.find(client);
  if (same != by_client_.end() && same->second >= limits_.max_per_client && !is_loopback(address))
    return false;
  // The table may have more entries than connections, because an evicted connection remains in the
  // table until its thread has ended.
  const size_t max_entries = limits_.max_connections + limits_.max_connections / 4 + 1;
  if (!removed_.wait_for(lock, kMaxEvictionWait, [&] { return entries_.size() < max_entries; }) ||
      (entries_.size() >= limits_.max_connections && !evict_one()))
    return false;
  place = entries_.insert(entries_.end(), Entry{socket, client, true, true, wall_seconds(), false});
  ++by_client_[client];
  return true;
}

// Closes the connection that has waited longest. Returns false if no connection may be closed. The
// connection's thread then finds the end of the stream and removes the entry. Until then the table
// has both this entry and the entry of the new connection.
bool ConnectionTable::evict_one() {
  const double now = wall_seconds();
  Entry* longest = nullptr;
  for (Entry& entry : entries_) {
    const bool may_be_closed =
        entry.waiting && !entry.evicted &&
        (entry.between_requests || now - entry.waiting_since_s >= kMinExchangeWaitS);
    if (may_be_closed && (!longest || entry.waiting_since_s < longest->waiting_since_s))
      longest = &entry;
  }
  if (!longest) return false;
  longest->evicted = true;
  shutdown(longest->socket, SHUT_RDWR);
  return true;
}

void ConnectionTable::set_waiting(Place place, double since_s, bool between_requests) {
  std::lock_guard lock(mutex_);
  place->waiting = true;
  place->between_requests = between_requests;
  place->waiting_since_s = since_s;
}

void ConnectionTable::set_working(Place place) {
  std::lock_guard lock(mutex_);
  place->waiting = false;
}

void ConnectionTable::remove(Place place) {
  std::lock_guard lock(mutex_);
  const auto count = by_client_.find(place->client);
  if (--count->second == 0) by_client_.erase(count);
  entries_.erase(place);
  removed_.notify_all();
}

size_t ConnectionTable::size() const {
  std::lock_guard lock(mutex_);
  return entries_.size();
}

void ConnectionTable::close_waiting() {
  std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_)
    if (entry.waiting && entry.between_requests) shutdown(entry.socket, SHUT_RD);
}

void ConnectionTable::close_all() {
  std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_) shutdown(entry.socket, SHUT_RDWR);
}

}  // namespace voxdag::server
