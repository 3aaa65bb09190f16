// Sets of the 16 columns of a cell, as bits 4 j + i of column (i, j) along axes 0 and 1.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag::color {

inline constexpr uint32_t kAllColumns = 0xffff;

// How many columns there are, and the sums of their i and j.
struct ColumnTotals {
  int64_t count, sum_i, sum_j;
};

VOXDAG_HD inline ColumnTotals totals_of(uint32_t columns) {
  ColumnTotals totals{0, 0, 0};
  for (uint32_t j = 0; j < 4; ++j) {
    const uint32_t row = columns >> (4 * j) & 15;
    // Four bits for each of the 16 sets that a row can be: how many there are, and the sum of i.
    const int64_t count = static_cast<int64_t>(0x4332322132212110u >> (4 * row) & 15);
    const int64_t sum = static_cast<int64_t>(0x6655443333221100u >> (4 * row) & 15);
    totals.count += count;
    totals.sum_i += sum;
    totals.sum_j += j * count;
  }
  return totals;
}

}  // namespace voxdag::color
