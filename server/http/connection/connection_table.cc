#include "server/http/connection/connection_table.h"

#include <sys/socket.h>

#include "core/base/clock.h"

namespace voxdag::server {

bool is_loopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1" || address.starts_with("::ffff:127.");
}

bool ConnectionTable::admit(int socket, const std::string& address, Place& place) {
  std::lock_guard lock(mutex_);
  const auto same = by_address_.find(address);
  if (same != by_address_.end() && same->second >= limits_.max_per_address && !is_loopback(address))
    return false;
  if (entries_.size() >= limits_.max_connections && !evict_one()) return false;
  place = entries_.insert(entries_.end(), Entry{socket, address, true, wall_seconds()});
  ++by_address_[address];
  return true;
}

// The thread of the evicted connection wakes up at the end of its stream and removes the entry.
// Until then the table holds one more than the limit.
bool ConnectionTable::evict_one() {
  Entry* longest = nullptr;
  for (Entry& entry : entries_)
    if (entry.waiting && (!longest || entry.waiting_since_s < longest->waiting_since_s))
      longest = &entry;
  if (!longest) return false;
  longest->waiting = false;
  shutdown(longest->socket, SHUT_RDWR);
  return true;
}

void ConnectionTable::set_waiting(Place place, bool waiting) {
  std::lock_guard lock(mutex_);
  if (waiting && !place->waiting) place->waiting_since_s = wall_seconds();
  place->waiting = waiting;
}

void ConnectionTable::remove(Place place) {
  std::lock_guard lock(mutex_);
  const auto count = by_address_.find(place->address);
  if (--count->second == 0) by_address_.erase(count);
  entries_.erase(place);
}

size_t ConnectionTable::size() const {
  std::lock_guard lock(mutex_);
  return entries_.size();
}

void ConnectionTable::close_waiting() {
  std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_)
    if (entry.waiting) shutdown(entry.socket, SHUT_RD);
}

void ConnectionTable::close_all() {
  std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_) shutdown(entry.socket, SHUT_RDWR);
}

}  // namespace voxdag::server
