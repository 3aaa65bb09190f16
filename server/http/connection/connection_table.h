// The open connections. The table limits their number and the memory of the answers that they send.
// If the table is full, a new connection replaces the connection that has waited longest for its
// client. If the memory is used up, a new answer replaces the answer that has waited longest. So
// clients that send or read little or nothing cannot keep other clients out. Thread-safe.
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
 public:
  // The client's action for which a connection waits: none, sending the head of a request, sending
  // a short body, or sending or receiving the rest of an exchange.
  enum class Waiting { kNot, kForRequest, kForShortBody, kInExchange };

 private:
  struct Entry {
    int socket;
    std::string client;
    bool is_exempt;  // true if the limits per client do not apply, as for the loopback
    Waiting waiting;
    double waiting_since_s;
    bool evicted;
    size_t answer_bytes = 0;  // memory of the answer
  };

 public:
  using Place = std::list<Entry>::iterator;

  // Maximum memory of the answers of all connections.
  static constexpr size_t kMaxAnswerBytes = 64 << 20;
  // Maximum memory of the answers of one client's connections. The loopback (a proxy) is exempt
  // and may use kMaxAnswerBytes.
  static constexpr size_t kMaxAnswerBytesPerClient = kMaxAnswerBytes / 2;

  explicit ConnectionTable(const HttpLimits& limits) : limits_(limits) {}

  // Adds a connection. Returns false if the client has too many connections, or if the table is
  // full and no connection may be closed. May take up to a second while many evicted connections
  // are still ending. Must be called by one thread only.
  bool admit(int socket, const std::string& address, Place& place);
  // Records that the connection has waited for its client since `since_s` (wall_seconds()).
  void set_waiting(Place place, double since_s, Waiting waiting);
  void set_working(Place place);
  // Removes the connection. Call it before closing the socket.
  void remove(Place place);

  // Reserves memory for an answer of the connection. If too little is free, closes connections
  // whose answers have waited longest for their clients, and waits up to a second for their memory.
  // Returns false if there is still too little. release_answer() or remove() frees the memory.
  bool reserve_answer(Place place, size_t bytes);
  void release_answer(Place place);

  size_t size() const;
  // Closes the connections that wait for a request or for the end of its header.
  void close_waiting();
  // Closes all connections and aborts answers in progress.
  void close_all();

 private:
  bool evict_one();
  // Closes the connection that has waited longest of all connections for which is_candidate(entry)
  // is true.
  template <class IsCandidate>
  bool evict_longest(const IsCandidate& is_candidate);
  template <class Counts>
  size_t answer_bytes(const Counts& counts) const;
  bool make_room_for_answer(const Entry& entry, size_t bytes);

  const HttpLimits& limits_;
  mutable std::mutex mutex_;          // guards all members below
  std::condition_variable removed_;   // a connection was removed
  std::condition_variable released_;  // memory of an answer was released
  std::list<Entry> entries_;
  std::map<std::string, size_t> by_client_;
  size_t bytes_since_trim_ = 0;  // bytes released since memory was last returned to the system
};

// True for addresses of the loopback: 127.0.0.0/8, also as ::ffff:127.x.x.x, and ::1.
bool is_loopback(const std::string& address);
// Returns the text that identifies a client: an IPv4 address, or the /64 of an IPv6 address,
// because one customer has all 2^64 addresses of a /64.
std::string client_of(const std::string& address);

}  // namespace voxdag::server
