// The event stream of one client for one job (docs/api.md, "Events of a job"). Used by one thread.
#pragma once

#include <atomic>
#include <optional>
#include <string>

#include "server/jobs/dispatcher.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {

class EventFeed {
 public:
  // Sends the state changes after event `last_seen`; without it only the current state.
  EventFeed(JobQueue& queue, const Dispatcher& dispatcher, const ServerConfig& config,
            const std::atomic<bool>& draining, std::string id, std::optional<int64_t> last_seen);

  // An EventSource: text to send, "" for nothing yet, no value at the end of the stream. Waits up
  // to about a second.
  std::optional<std::string> next();

 private:
  void wait();
  void add_changes(std::string& text);
  void add_progress(std::string& text);

  JobQueue& queue_;
  const Dispatcher& dispatcher_;
  const ServerConfig& config_;
  const std::atomic<bool>& draining_;
  const std::string id_;
  int64_t last_number_ = -1;  // of the newest event sent; -1 before the first
  bool started_ = false;
  bool ended_ = false;
  uint64_t seen_version_ = 0, seen_changes_ = 0, seen_progress_ = 0;
  double last_sent_s_ = 0, last_progress_s_ = 0;
};

}  // namespace voxdag::server
