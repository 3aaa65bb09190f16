// The rate of a stage over time, for charts. The memory is bounded: the longer a stage runs, the
// longer are the intervals over which the rate is averaged. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace voxdag::server {

class RateHistory {
 public:
  static constexpr size_t kMaxPoints = 100;

  struct Point {
    double wall_s;  // end of the interval, since the stage began
    double rate;    // units per second in this interval
  };

  // `done` is the number of units that were completed when the stage began.
  explicit RateHistory(uint64_t done = 0) : marks_{{0, done}} {}

  // Records that `done` units are completed. Ignores a time before the preceding one.
  void add(double wall_s, uint64_t done);
  // Returns at most kMaxPoints points, in the order of their times. Each interval begins at the end
  // of the preceding interval; the first one begins with the stage.
  std::vector<Point> points() const;
  // Returns the rate of the last point; 0 if there is none.
  double rate() const;

 private:
  struct Mark {
    double wall_s;
    uint64_t done;
  };

  // Doubles the length of the intervals.
  void merge_pairs();

  std::vector<Mark> marks_;  // the begin of the stage, and the ends of the intervals
  double interval_s_ = 1;    // minimum length of all intervals except for the last one
};

}  // namespace voxdag::server
