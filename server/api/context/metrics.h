// Counters for /metrics in the Prometheus text format. Thread-safe.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "server/queue/job.h"

namespace voxdag::server {

// A value measured when /metrics is read: a counter if its name ends with _total, else a gauge.
// Samples of one name with different labels must be neighbors.
struct Sample {
  const char* name;
  const char* help;
  double value;
  std::string labels = "";  // such as: state="queued"
};

class Metrics {
 public:
  // Counts an answered request; `wall_s` is the time until its answer.
  void count_request(int status, double wall_s);
  void count_uploaded(uint64_t bytes) { uploaded_bytes_ += bytes; }
  void count_downloaded(uint64_t bytes) { downloaded_bytes_ += bytes; }
  // Counts a run of a job that has ended, by the job's new state.
  void count_run(const Job& job);

  // Returns all metrics as text: the counters, the number of jobs by state (`jobs`), and `samples`.
  std::string text(const std::map<JobState, uint64_t>& jobs, std::vector<Sample> samples) const;

 private:
  // Upper bounds of the buckets of the request duration histogram; the last bucket has no bound.
  static constexpr std::array<double, 8> kBoundsS = {0.001, 0.005, 0.01, 0.05, 0.1, 0.5, 1, 10};

  mutable std::mutex mutex_;  // guards all members except the atomics
  std::map<int, uint64_t> requests_;
  std::array<uint64_t, kBoundsS.size() + 1> durations_{};
  double duration_sum_s_ = 0;
  std::map<std::string, uint64_t> runs_;  // keyed by state
  uint64_t voxels_ = 0, result_bytes_ = 0;
  double build_wall_s_ = 0, build_cpu_s_ = 0;
  std::atomic<uint64_t> uploaded_bytes_{0}, downloaded_bytes_{0};
};

}  // namespace voxdag::server
