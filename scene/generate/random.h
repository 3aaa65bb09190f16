// Random numbers for generated scenes, by splitmix64. The distributions of the standard library are
// not used, because they differ between its implementations. Each object of a scene has its own
// generator, whose seed includes the object's coordinates. So the numbers of an object do not
// depend on other objects.
//
// Never draw twice among the arguments of one call: the order of their evaluation is unspecified.
// (Within braces, the order is fixed.)
#pragma once

#include <cstdint>
#include <initializer_list>

#include "core/base/integers.h"

namespace voxdag {

class Random {
 public:
  Random(uint64_t seed, std::initializer_list<uint64_t> coordinates) : state_(mix_bits(seed)) {
    for (uint64_t coordinate : coordinates) state_ = mix_bits((state_ + kStep) ^ coordinate);
  }

  uint64_t bits() { return mix_bits(state_ += kStep); }
  // Returns a number from 0 to count - 1.
  uint32_t below(uint32_t count) {
    return static_cast<uint32_t>((static_cast<uint128>(bits()) * count) >> 64);
  }
  // Returns a number from low to high, inclusive.
  int between(int low, int high) {
    return low + static_cast<int>(below(static_cast<uint32_t>(high - low + 1)));
  }
  bool chance(uint32_t percent) { return below(100) < percent; }
  // Returns a multiple of 2^-24 in [0, 1).
  double unit() { return static_cast<double>(bits() >> 40) * 0x1p-24; }
  // Returns a multiple of 2^-23 in [-1, 1).
  double signed_unit() { return 2.0 * unit() - 1.0; }

 private:
  static constexpr uint64_t kStep = 0x9e3779b97f4a7c15ull;
  uint64_t state_;
};

}  // namespace voxdag
