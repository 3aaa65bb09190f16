#include "tests/cuda_sim/sim/schedule.h"

#include <numeric>

namespace voxdag::cuda_sim {
namespace {

Schedule g_schedule;
uint64_t g_state = 1;

}  // namespace

void set_schedule(const Schedule& schedule) {
  g_schedule = schedule;
  g_state = schedule.seed;
}

Schedule schedule() { return g_schedule; }

// SplitMix64.
uint32_t random_below(uint32_t end) {
  uint64_t z = g_state += 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return static_cast<uint32_t>((z ^ z >> 31) % end);
}

RandomOrder::RandomOrder(uint32_t n) : n_(n), at_(random_below(n)), stride_(1 + random_below(n)) {
  while (std::gcd(stride_, n) != 1) ++stride_;
}

}  // namespace voxdag::cuda_sim
