// Delays before retries. The first delay is half a second, and each later delay is twice as long,
// up to ten seconds. After five minutes of delays in total, no further retry is allowed. Used by
// one thread.
#pragma once

#include "client/http_client.h"
#include "voxdag/cancel_token.h"

namespace voxdag::client {

class RetryPolicy {
 public:
  explicit RetryPolicy(const CancelToken& cancel) : cancel_(cancel) {}
  // Waits before the next attempt, for at least `min_wait_s` seconds but not longer than five
  // minutes, and returns true. Returns false without waiting if the total time for retries is used
  // up. Throws Error{kCanceled} if the token is canceled.
  bool wait(double min_wait_s = 0);
  // Restarts the delays. Call it after an attempt that made progress.
  void reset() { waited_s_ = 0, pause_s_ = kFirstPauseS; }

 private:
  static constexpr double kFirstPauseS = 0.5;
  const CancelToken& cancel_;
  double waited_s_ = 0, pause_s_ = kFirstPauseS;
};

// If the status means that the server is busy (408, 429, 502 to 504), returns the number of seconds
// to wait before the next request: the value of the header Retry-After, or 0 without this header.
// Returns -1 for any other status, because a retry would give the same answer.
double retry_after_s(const ClientResponse& response);

// Sleeps. Throws Error{kCanceled} within about 50 ms of a cancellation.
void sleep_for(double seconds, const CancelToken& cancel);

}  // namespace voxdag::client
