// The open connections, within their limits. When the table is full, the connection that has waited
// longest for its client (for a request or the rest of its header) is closed in favor of the new
// one, so that idle clients cannot keep others out. Thread-safe.
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <mutex>
#include <string>

#include "server/http/limits.h"

namespace voxdag::server {

class ConnectionTable {
 private:
  struct Entry {
    int socket;
    std::string address;
    bool waiting;  // for its client
    double waiting_since_s;
  };

 public:
  using Place = std::list<Entry>::iterator;

  explicit ConnectionTable(const HttpLimits& limits) : limits_(limits) {}

  // False if the address has too many connections, or the table is full and none is waiting.
  bool admit(int socket, const std::string& address, Place& place);
  void set_waiting(Place place, bool waiting);
  // Must be called before the socket is closed.
  void remove(Place place);

  size_t size() const;
  void close_waiting();
  // Aborts answers in flight, too.
  void close_all();

 private:
  bool evict_one();

  const HttpLimits& limits_;
  mutable std::mutex mutex_;  // guards all below
  std::list<Entry> entries_;
  std::map<std::string, size_t> by_address_;
};

// 127.0.0.0/8 and ::1.
bool is_loopback(const std::string& address);

}  // namespace voxdag::server
