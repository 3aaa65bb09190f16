// Measures the stages of a build, which run one after another. Used by one thread.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/clock.h"

namespace voxdag {

struct StageTime {
  std::string name;
  double wall_s = 0;
  double cpu_s = 0;  // CPU time of all threads of the process
  // CPU time of the busiest thread as a fraction of cpu_s, from 0 to 1 (ThreadTimes).
  double largest_thread_share = 0;
};

class StageClock {
 public:
  // Calls `on_finish`, if set, with every stage that has ended.
  explicit StageClock(std::function<void(const StageTime&)> on_finish = {})
      : on_finish_(std::move(on_finish)) {}

  // Ends stage `name`. The stage began when the previous one ended.
  void finish(const std::string& name) {
    const double wall = wall_seconds(), cpu = process_cpu_seconds();
    const ThreadTimes::Seconds threads = ThreadTimes::now();
    double largest = 0;
    for (size_t i = 0; i < threads.size(); ++i)
      largest = std::max(largest, threads[i] - threads_[i]);
    const double share = cpu > cpu_ ? std::min(largest / (cpu - cpu_), 1.0) : 1.0;
    stages_.push_back({name, wall - wall_, cpu - cpu_, share});
    wall_ = wall;
    cpu_ = cpu;
    threads_ = threads;
    if (on_finish_) on_finish_(stages_.back());
  }
  const std::vector<StageTime>& stages() const { return stages_; }

 private:
  std::function<void(const StageTime&)> on_finish_;
  std::vector<StageTime> stages_;
  double wall_ = wall_seconds();
  double cpu_ = process_cpu_seconds();
  ThreadTimes::Seconds threads_ = ThreadTimes::now();
};

}  // namespace voxdag
