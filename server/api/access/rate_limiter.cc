#include "server/api/access/rate_limiter.h"

#include <algorithm>

namespace voxdag::server {
namespace {

constexpr double kDepthS = 2;  // a full bucket has tokens for the requests of this many seconds
// If more buckets than this number exist, full buckets are dropped. This changes no limit, because
// a client without a bucket gets a new bucket, which is also full.
constexpr size_t kMaxBuckets = 10000;
constexpr double kSweepIntervalS = 1;

}  // namespace

bool RateLimiter::take(const std::string& client, double now_s) {
  if (per_s_ <= 0) return true;
  std::lock_guard lock(mutex_);
  const double depth = std::max(1.0, per_s_ * kDepthS);
  if (buckets_.size() > kMaxBuckets && now_s >= next_sweep_s_) {
    next_sweep_s_ = now_s + kSweepIntervalS;
    std::erase_if(buckets_, [&](const auto& entry) {
      return entry.second.level + (now_s - entry.second.at_s) * per_s_ >= depth;
    });
  }
  Bucket& bucket = buckets_.try_emplace(client, Bucket{depth, now_s}).first->second;
  bucket.level = std::min(depth, bucket.level + (now_s - bucket.at_s) * per_s_);
  bucket.at_s = now_s;
  if (bucket.level < 1) return false;
  bucket.level -= 1;
  return true;
}

}  // namespace voxdag::server
