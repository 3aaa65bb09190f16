// Decides, from a seed, when queued work runs, and the order of work whose order CUDA does not
// specify.
#pragma once

#include <cstdint>

namespace voxdag::cuda_sim {

struct Schedule {
  // True: operations run at the last moment that synchronization allows. False: some of them also
  // run earlier, at random calls of the runtime.
  bool late = true;
  uint64_t seed = 1;
};

// Sets the schedule of all streams, and restarts the random numbers from its seed.
void set_schedule(const Schedule& schedule);
Schedule schedule();

// Returns the next random number below `end`.
uint32_t random_below(uint32_t end);

// Visits each number from 0 to n - 1 once. Begins at a random number and adds a random stride
// modulo n; the stride and n have no common divisor.
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
