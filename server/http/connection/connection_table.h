// The open connections, within their limits. If the table is full, a new connection replaces the
// connection that has waited longest for its client. So clients that send little or nothing cannot
// keep other clients out. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <list>
#include <map>
#include <mutex>
#include <string>

#include "server/http/connection/limits.h"

namespace voxdag::server {

class ConnectionTable {
 private:
  struct Entry {
    int socket;
    std::string client;
    bool waiting;           // waits for the client to send or receive
    bool between_requests;  // waits for the rest of a request's head
    double waiting_since_s;
    bool evicted;
  };

 public:
  using Place = std::list<Entry>::iterator;

  explicit ConnectionTable(const HttpLimits& limits) : limits_(limits) {}

  // Adds a connection. Returns false if the client has too many connections, or if the table is
  // full and no connection may be closed. May take up to a second while many evicted connections
  // are still ending. Must be called by one thread only.
  bool admit(int socket, const std::string& address, Place& place);
  // Records that the connection has waited for its client since `since_s` (wall_seconds()).
  void set_waiting(Place place, double since_s, bool between_requests);
  void set_working(Place place);
  // Call it before closing the socket.
  void remove(Place place);

  size_t size() const;
  // Closes the connections that wait for a request or for the end of its header.
  void close_waiting();
  // Closes all connections and aborts answers in progress.
  void close_all();

 private:
  bool evict_one();

  const HttpLimits& limits_;
  mutable std::mutex mutex_;  // guards all members below
  std::condition_variable removed_;
  std::list<Entry> entries_;
  std::map<std::string, size_t> by_client_;
};

// True for addresses of the loopback: 127.0.0.0/8, also as ::ffff:127.x.x.x, and ::1.
bool is_loopback(const std::string& address);
// Returns the text that identifies a client: an IPv4 address, or the /64 of an IPv6 address,
// because one customer has all 2^64 addresses of a /64.
std::string client_of(const std::string& address);

}  // namespace voxdag::server
