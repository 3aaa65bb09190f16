// Rate limit per client: a token bucket that holds the requests of two seconds. Thread-safe.
#pragma once

#include <map>
#include <mutex>
#include <string>

namespace voxdag::server {

class RateLimiter {
 public:
  // A rate of 0 means no limit.
  explicit RateLimiter(double per_s) : per_s_(per_s) {}

  // Takes one token from the client's bucket. Returns false if the bucket is empty. `now_s`: time
  // of the call, in wall_seconds().
  bool take(const std::string& client, double now_s);

 private:
  struct Bucket {
    double level;
    double at_s;
  };

  const double per_s_;
  std::mutex mutex_;  // guards buckets_ and next_sweep_s_
  std::map<std::string, Bucket> buckets_;
  double next_sweep_s_ = 0;
};

}  // namespace voxdag::server
