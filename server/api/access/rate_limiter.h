// How often each client may do a thing: a bucket of tokens per client, refilled steadily, as deep
// as two seconds' worth. Thread-safe.
#pragma once

#include <map>
#include <mutex>
#include <string>

namespace voxdag::server {

class RateLimiter {
 public:
  // `per_s` of 0 limits nobody.
  explicit RateLimiter(double per_s) : per_s_(per_s) {}

  // Takes one from the client's bucket; false if it is empty.
  bool take(const std::string& client, double now_s);

 private:
  struct Bucket {
    double level;
    double at_s;
  };

  const double per_s_;
  std::mutex mutex_;  // guards the map
  std::map<std::string, Bucket> buckets_;
};

}  // namespace voxdag::server
