// All connections at a time, within their limits. When the table is full, the connection that has
// waited longest for its client (for a request or for the rest of its header) is hung up for the
// new one; so clients that only hold places cannot keep others out. Thread-safe.
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
    bool waits;      // for its client
    double since_s;  // it does
  };

 public:
  using Place = std::list<Entry>::iterator;

  explicit ConnectionTable(const HttpLimits& limits) : limits_(limits) {}

  // False if this connection is one too many: of its address, or while all others are at work.
  bool admit(int socket, const std::string& address, Place& place);
  void set_waiting(Place place, bool waits);
  // To be called before the socket is closed.
  void remove(Place place);

  size_t size() const;
  // Hangs up those that wait, or all. What is being answered then breaks off.
  void hang_up_waiting();
  void hang_up_all();

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
