// A sum of colors in 128-bit integers, which never overflows. A ColorSum (color_sum.h, 64 bits)
// overflows after about 10^9 white cells, and a cell near the root can contain that many.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/base/integers.h"
#include "core/color/color_sum.h"

namespace voxdag {

struct WideSum {
  std::array<uint128, 3> seen{}, plain{};
  uint128 seen_weight = 0, weight = 0;

  // Adds a ColorSum or WideSum.
  template <class Sum>
  void add(const Sum& other) {
    for (size_t c = 0; c < 3; ++c) {
      seen[c] += other.seen[c];
      plain[c] += other.plain[c];
    }
    seen_weight += other.seen_weight;
    weight += other.weight;
  }

  // Returns the number of low bits that narrow() must drop so that the sum fits a ColorSum; 0 if
  // it already fits. Leaves one high bit free, because narrow() can round values up.
  int excess_bits() const {
    uint128 all = seen_weight | weight;
    for (size_t c = 0; c < 3; ++c) all |= seen[c] | plain[c];
    const auto high = static_cast<uint64_t>(all >> 64);
    return high == 0 ? 0 : static_cast<int>(std::bit_width(high)) + 1;
  }

  // Returns the sum divided by 2^bits, which has the same color. If the seen_weight of the result
  // (or its weight, if all surfaces are transparent) would be below kPrecise, rounding could change
  // the color. In this case, returns the mean color of the sum, with a weight of at least 1.
  ColorSum narrow(int bits) const {
    constexpr uint64_t kPrecise = uint64_t{1} << 16;
    ColorSum sum;
    sum.weight = static_cast<uint64_t>(weight >> bits);
    sum.seen_weight = static_cast<uint64_t>(seen_weight >> bits);
    const bool is_precise =
        bits == 0 || sum.seen_weight >= kPrecise || (seen_weight == 0 && sum.weight >= kPrecise);
    if (!is_precise) {
      sum.weight = std::max<uint64_t>(sum.weight, 1);
      const auto alpha = static_cast<uint64_t>(seen_weight / weight);
      sum.seen_weight = seen_weight == 0 ? 0 : std::max<uint64_t>(sum.weight * alpha, 1);
    }
    for (size_t c = 0; c < 3; ++c) {
      sum.plain[c] = is_precise ? static_cast<uint64_t>(plain[c] >> bits)
                                : sum.weight * static_cast<uint64_t>(plain[c] / weight);
      sum.seen[c] = is_precise ? static_cast<uint64_t>(seen[c] >> bits)
                    : seen_weight == 0
                        ? 0
                        : sum.seen_weight * static_cast<uint64_t>(seen[c] / seen_weight);
    }
    return sum;
  }
};

}  // namespace voxdag
