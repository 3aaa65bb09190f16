// Rate limit per client: a token bucket that holds two seconds' worth. Thread-safe.
#pragma once

#include <map>
#include <mutex>
#include <string>

namespace voxdag::server {

class RateLimiter {
 public:
  // A rate of 0 means no limit.
  explicit RateLimiter(double per_s) : per_s_(per_s) {}

  // Takes one token of the client's bucket; false if it is empty.
  bool take(const std::string& client, double now_s);

 private:
  struct Bucket {
    double level;
    double at_s;
  };

  const double per_s_;
  std::mutex mutex_;  // guards the next
  std::map<std::string, Bucket> buckets_;
  double next_sweep_s_ = 0;
};

}  // namespace voxdag::server
