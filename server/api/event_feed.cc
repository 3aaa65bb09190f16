#include "server/api/event_feed.h"

#include <algorithm>

#include "core/base/clock.h"
#include "server/api/job_json.h"

namespace voxdag::server {
namespace {

constexpr double kProgressInterval_s = 0.5;
constexpr double kKeepAliveInterval_s = 15;
constexpr double kMaxWait_s = 1;

std::string event_text(const char* name, const std::string& data, int64_t id = -1) {
  std::string text = "event: " + std::string(name) + "\n";
  if (id >= 0) text += "id: " + std::to_string(id) + "\n";
  return text + "data: " + data + "\n\n";
}

std::string state_data(const JobEvent& event) {
  return "{\"seq\":" + std::to_string(event.number) + ",\"at\":\"" + time_text(event.at_s) +
         "\",\"state\":\"" + state_name(event.state) +
         "\",\"attempt\":" + std::to_string(event.attempt) +
         ",\"error\":" + (event.error.empty() ? "null" : '"' + event.error + '"') + "}";
}

}  // namespace

EventFeed::EventFeed(JobQueue& queue, const Dispatcher& dispatcher, const ServerConfig& config,
                     const std::atomic<bool>& draining, std::string id,
                     std::optional<int64_t> last_seen)
    : queue_(queue),
      dispatcher_(dispatcher),
      config_(config),
      draining_(draining),
      id_(std::move(id)),
      last_number_(last_seen.value_or(-1)) {}

std::optional<std::string> EventFeed::next() {
  if (ended_ || draining_) return {};
  std::string text;
  if (!started_)
    text = "retry: 3000\n\n";
  else
    wait();
  seen_version_ = queue_.version();
  if (const uint64_t changes = queue_.changes(); !started_ || changes != seen_changes_) {
    seen_changes_ = changes;
    add_changes(text);
  }
  if (!ended_) add_progress(text);
  started_ = true;
  const double now = wall_seconds();
  if (text.empty() && now - last_sent_s_ > kKeepAliveInterval_s) text = ": keep-alive\n\n";
  if (!text.empty()) last_sent_s_ = now;
  return text;
}

void EventFeed::wait() {
  // Wakes up in time for progress that came too soon after the last event.
  const double left_s = last_progress_s_ + kProgressInterval_s - wall_seconds();
  queue_.wait_for_change(seen_version_, left_s > 0 ? left_s : kMaxWait_s);
}

void EventFeed::add_changes(std::string& text) {
  const auto job = queue_.find(id_);
  if (!job) {
    ended_ = true;
    return;
  }
  // A new stream begins with the job itself, which makes its past state changes redundant.
  const bool resumed = last_number_ >= 0;
  for (const JobEvent& event : queue_.events_after(id_, last_number_)) {
    if (resumed) text += event_text("state", state_data(event), event.number);
    last_number_ = event.number;
  }
  const auto live = dispatcher_.live(id_);
  text += event_text("job", job_json(*job, live.get(), 0, config_.jobs.max_attempts), last_number_);
  if (has_ended(job->state)) {
    text += event_text("end", "{\"state\":\"" + std::string(state_name(job->state)) + "\"}");
    ended_ = true;
  }
}

void EventFeed::add_progress(std::string& text) {
  const auto live = dispatcher_.live(id_);
  if (!live) return;
  const uint64_t version = live->version();
  const double now = wall_seconds();
  if (version == seen_progress_ || now - last_progress_s_ < kProgressInterval_s) return;
  const std::string progress = live->progress_json();
  if (progress.empty()) return;
  seen_progress_ = version;
  last_progress_s_ = now;
  text += event_text("progress", progress);
}

}  // namespace voxdag::server
