// Measures the stages of a build, which follow one another. Not thread-safe.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/clock.h"

namespace voxdag {

struct StageTime {
  std::string name;
  double wall_s = 0;
  double cpu_s = 0;  // of the whole process
};

class StageClock {
 public:
  // `on_finish`, if there is one, is called with every stage that ended.
  explicit StageClock(std::function<void(const StageTime&)> on_finish = {})
      : on_finish_(std::move(on_finish)) {}

  // Ends stage `name`, which began when the one before it ended.
  void finish(const std::string& name) {
    const double wall = wall_seconds(), cpu = process_cpu_seconds();
    stages_.push_back({name, wall - wall_, cpu - cpu_});
    wall_ = wall;
    cpu_ = cpu;
    if (on_finish_) on_finish_(stages_.back());
  }
  const std::vector<StageTime>& stages() const { return stages_; }

 private:
  std::function<void(const StageTime&)> on_finish_;
  std::vector<StageTime> stages_;
  double wall_ = wall_seconds();
  double cpu_ = process_cpu_seconds();
};

}  // namespace voxdag
