// Decides by a seed when queued work runs, and in which order if the order is unspecified.
#pragma once

#include <cstdint>

namespace voxdag::cuda_sim {

struct Schedule {
  // Late: work runs at the last moment that synchronization allows. Otherwise some of it runs
  // whenever a call is made.
  bool late = true;
  uint64_t seed = 1;
};

// For all streams; restarts the random numbers.
void set_schedule(const Schedule& schedule);
Schedule schedule();

// The next random number below `end`.
uint32_t random_below(uint32_t end);

// Visits 0 to n - 1 in some order: steps of a random odd or coprime stride from a random start.
class RandomOrder {
 public:
  explicit RandomOrder(uint32_t n);
  uint32_t next() {
    const uint32_t now = at_;
    at_ = static_cast<uint32_t>((uint64_t{at_} + stride_) % n_);
    return now;
  }

 private:
  uint32_t n_, at_, stride_;
};

}  // namespace voxdag::cuda_sim
