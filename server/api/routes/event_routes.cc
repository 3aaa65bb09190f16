// Serves the server-sent events of a job.
#include "core/base/clock.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "server/api/answers/job_json.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/routes.h"
#include "server/base/time_text.h"

namespace voxdag::server {
namespace {

constexpr double kProgressIntervalS = 0.5;
constexpr double kKeepAliveIntervalS = 15;
constexpr double kMaxWaitS = 1;

std::string event_text(const char* name, const std::string& data, int64_t id = -1) {
  std::string text = "event: " + std::string(name) + "\n";
  if (id >= 0) text += "id: " + std::to_string(id) + "\n";
  return text + "data: " + data + "\n\n";
}

std::string state_data(const JobEvent& event) {
  return "{\"seq\":" + std::to_string(event.number) + ",\"at\":\"" + time_text(event.at_s) +
         "\",\"state\":\"" + state_name(event.state) +
         "\",\"attempt\":" + std::to_string(event.attempt) +
         ",\"error\":" + (event.error.empty() ? "null" : '"' + printable_line(event.error) + '"') +
         "}";
}

// The event stream of one client for one job (docs/api.md, "Events of a job"). Used by one thread.
class EventFeed {
 public:
  // Sends the state changes after event `last_seen`. If `last_seen` is nullopt, sends only the
  // current state.
  EventFeed(Context& context, std::string id, std::optional<int64_t> last_seen)
      : context_(context), id_(std::move(id)), last_number_(last_seen.value_or(-1)) {}

  // An EventSource (message.h): returns the text to send next, "" if there is nothing to send yet,
  // or nullopt at the end of the stream. Waits up to about a second.
  std::optional<std::string> next();

 private:
  void wait();
  void add_changes(std::string& text);
  void add_progress(std::string& text);

  Context& context_;
  const std::string id_;
  int64_t last_number_ = -1;  // number of the newest event sent; -1 before the first
  bool started_ = false;
  bool ended_ = false;
  uint64_t seen_version_ = 0, seen_changes_ = 0, seen_progress_ = 0;
  double last_sent_s_ = 0, last_progress_s_ = 0;
};

std::optional<std::string> EventFeed::next() {
  if (ended_ || context_.draining) return {};
  std::string text;
  if (!started_)
    text = "retry: 3000\n\n";
  else
    wait();
  seen_version_ = context_.queue.version();
  if (const uint64_t changes = context_.queue.changes(); !started_ || changes != seen_changes_) {
    seen_changes_ = changes;
    add_changes(text);
  }
  if (!ended_) add_progress(text);
  started_ = true;
  const double now = wall_seconds();
  if (text.empty() && now - last_sent_s_ > kKeepAliveIntervalS) text = ": keep-alive\n\n";
  if (!text.empty()) last_sent_s_ = now;
  return text;
}

void EventFeed::wait() {
  // Progress events have a minimum interval. If a progress event is delayed until the end of this
  // interval, the wait also ends then.
  const double left_s = last_progress_s_ + kProgressIntervalS - wall_seconds();
  context_.queue.wait_for_change(seen_version_, left_s > 0 ? left_s : kMaxWaitS);
}

void EventFeed::add_changes(std::string& text) {
  const auto permit = context_.answers.wait();
  const auto job = context_.queue.find(id_);
  if (!job) {
    ended_ = true;
    return;
  }
  // A new stream begins with the event "job", which has the current state. So its first call sends
  // no earlier state changes. A resumed stream first sends the changes that the client has missed.
  const bool resumed = last_number_ >= 0;
  for (const JobEvent& event : context_.queue.events_after(id_, last_number_)) {
    if (resumed) text += event_text("state", state_data(event), event.number);
    last_number_ = event.number;
  }
  const auto live = context_.dispatcher.live(id_);
  text += event_text("job",
                     job_json(*job, live.get(), 0, context_.config.jobs.max_attempts,
                              context_.webhooks.job_member(*job)),
                     last_number_);
  if (has_ended(job->state)) {
    text += event_text("end", "{\"state\":\"" + std::string(state_name(job->state)) + "\"}");
    ended_ = true;
  }
}

void EventFeed::add_progress(std::string& text) {
  const auto live = context_.dispatcher.live(id_);
  if (!live) return;
  const uint64_t version = live->version();
  const double now = wall_seconds();
  if (version == seen_progress_ || now - last_progress_s_ < kProgressIntervalS) return;
  const std::string progress = live->progress_json();
  if (progress.empty()) return;
  seen_progress_ = version;
  last_progress_s_ = now;
  text += event_text("progress", progress);
}

std::optional<int64_t> last_event_id(const Request& request) {
  const auto number = parse_numbers<int64_t, 1>(request.header("Last-Event-ID"), 0);
  if (!number || (*number)[0] < 0) return {};
  return (*number)[0];
}

Response follow(Context& context, Call& call) {
  find_job(context.queue, call.names[0]);
  Response response = make_response(200, "text/event-stream", "no-store");
  response.headers.emplace("X-Accel-Buffering", "no");  // a proxy must not buffer events
  if (call.request.method == "HEAD") {
    response.is_stream = true;
    return response;
  }
  auto permit = context.event_streams.acquire(call.caller.client);
  if (!permit) throw busy("too many event streams: " + context.event_streams.limits(), 10);
  const auto feed =
      std::make_shared<EventFeed>(context, call.names[0], last_event_id(call.request));
  response.next_event = [feed] { return feed->next(); };
  response.permit = std::move(permit);
  return response;
}

}  // namespace

void add_event_routes(Router& router) {
  router.add({.method = "GET",
              .pattern = "/api/v1/jobs/{id}/events",
              .id = "followJob",
              .summary = "Server-sent events: state, job, progress, end",
              .tag = "jobs",
              .headers = {{"Last-Event-ID", "id of the last event received"}},
              .answers = {{200, "a stream that ends with the job", {{"text/event-stream"}}}},
              .problems = {404}},
             follow);
}

}  // namespace voxdag::server
