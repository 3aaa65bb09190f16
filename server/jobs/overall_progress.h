// Computes the progress of a job over all its stages. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scheduler/spec/build_spec.h"

namespace voxdag::server {

// A stage of a job's current attempt.
struct StageProgress {
  std::string name, unit;
  uint64_t done = 0, total = 0;  // in units; a total of 0 means that it is unknown
  uint64_t resumed_at = 0;       // units of `done` that earlier attempts completed
  double start_s = 0, wall_s = 0;
  bool ended = false;
  // Average of units per second in this attempt; 0 if unknown.
  double average_rate() const;
  // Estimated remaining seconds of the stage; 0 if unknown or ended.
  double eta_s() const;
};

// A long stage, and its typical duration relative to the other long stages.
struct StageShare {
  const char* stage;
  double share;
};

// Returns the long stages of a build with these options, in their order.
std::vector<StageShare> long_stages(const GeometryOptions& options);

struct OverallProgress {
  double fraction = 0;          // completed fraction of the job, 0 to 1
  std::optional<double> eta_s;  // estimated remaining seconds; nullopt if unknown
};

// Returns the progress of an attempt that has begun the stages `begun`. While the attempt is in a
// stage that is not in `shares`, the fraction does not change.
OverallProgress overall_progress(std::span<const StageProgress> begun,
                                 std::span<const StageShare> shares);

}  // namespace voxdag::server
