// The server-sent events of a job.
#include <charconv>

#include "server/api/context.h"
#include "server/api/event_feed.h"
#include "server/api/problem.h"
#include "server/api/routes/router.h"

namespace voxdag::server {
namespace {

std::optional<int64_t> last_event_id(const Request& request) {
  const std::string text = request.header("Last-Event-ID");
  int64_t number = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || parsed.ec != std::errc{} || parsed.ptr != text.data() + text.size() ||
      number < 0)
    return {};
  return number;
}

Response follow(Context& context, Call& call) {
  call.allow_query({});
  find_job(context.queue, call.names[0]);
  Response response;
  response.headers.emplace("Content-Type", "text/event-stream");
  response.headers.emplace("Cache-Control", "no-store");
  response.headers.emplace("X-Accel-Buffering", "no");  // a proxy must not buffer events
  if (call.request.method == "HEAD") return response;
  auto permit = context.event_streams.acquire();
  if (!permit) throw busy("too many event streams", 10);
  const auto feed =
      std::make_shared<EventFeed>(context.queue, context.dispatcher, context.config,
                                  context.draining, call.names[0], last_event_id(call.request));
  response.next_event = [feed] { return feed->next(); };
  response.permit = std::move(permit);
  return response;
}

}  // namespace

void add_event_routes(Router& router, Context& context) {
  router.add("GET", "/api/v1/jobs/{id}/events", Role::kRead,
             [&](Call& call) { return follow(context, call); });
}

}  // namespace voxdag::server
