#include "server/jobs/run_child.h"

#include "core/base/clock.h"

namespace voxdag::server {

ChildProcess::End run_child(const ChildProcess::Start& start, LiveJob& live, double stop_timeout_s,
                            double max_s, const std::function<void()>& on_message) {
  ChildProcess child(start);
  bool stop_sent = false;
  const double started_s = wall_seconds();
  child.read_lines(
      [&](std::string_view line) {
        const auto message = decode(line);
        if (!message) return;
        live.apply(*message);
        on_message();
      },
      [&] {
        const double stop_s = live.stop_requested_s(), now = wall_seconds();
        if (stop_s > 0 && !stop_sent) child.request_stop();
        stop_sent = stop_s > 0;
        return (stop_sent && now > stop_s + stop_timeout_s) || now > started_s + max_s;
      });
  return child.wait();
}

}  // namespace voxdag::server
