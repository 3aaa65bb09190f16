#include "client/retry_policy.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <thread>

namespace voxdag::client {
namespace {

constexpr double kMaxPauseS = 10;
constexpr double kMaxWaitS = 300;
constexpr double kCancelCheckS = 0.05;

}  // namespace

bool RetryPolicy::wait(double min_wait_s) {
  if (waited_s_ >= kMaxWaitS) return false;
  const double seconds = std::max(pause_s_, std::min(min_wait_s, kMaxWaitS));
  sleep_for(seconds, cancel_);
  waited_s_ += seconds;
  pause_s_ = std::min(kMaxPauseS, 2 * pause_s_);
  return true;
}

double retry_after_s(const ClientResponse& response) {
  switch (response.status) {
    case 408:
    case 429:
    case 502:
    case 503:
    case 504:
      break;
    default:
      return -1;
  }
  const std::string text = response.header("Retry-After");
  unsigned seconds = 0;
  std::from_chars(text.data(), text.data() + text.size(), seconds);
  return seconds;
}

void sleep_for(double seconds, const CancelToken& cancel) {
  for (; seconds > 0; seconds -= kCancelCheckS) {
    cancel.check();
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(seconds, kCancelCheckS)));
  }
  cancel.check();
}

}  // namespace voxdag::client
