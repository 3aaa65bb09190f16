// The wall and CPU time of a command.
#pragma once

#include "core/base/clock.h"
#include "core/base/process_limits.h"

namespace voxdag::cli {

struct RunTimes {
  double wall_s = 0;
  double cpu_s = 0;  // CPU time of all threads of the process
};

// Measures the wall time and CPU time since its construction.
class RunTimer {
 public:
  RunTimes elapsed() const {
    return {wall_seconds() - start_.wall_s, process_cpu_seconds() - start_.cpu_s};
  }

 private:
  const RunTimes start_{wall_seconds(), process_cpu_seconds()};
};

}  // namespace voxdag::cli
