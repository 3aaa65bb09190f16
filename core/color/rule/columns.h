// Sets of the 16 columns of a cell (cell_triangle.h) as bit masks. Column (i, j) has bit 4 j + i;
// i counts along axis 0 and j along axis 1.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/exact.h"

namespace voxdag::color {

inline constexpr uint32_t kAllColumns = 0xffff;

// The number of columns in a set, and the sums of their i and j.
struct ColumnTotals {
  int64_t count, sum_i, sum_j;
};

// The members of ColumnTotals for each of the 256 sets of columns in two rows (j is 0 or 1).
struct ColumnTable {
  uint8_t count[256] = {}, sum_i[256] = {}, sum_j[256] = {};
  constexpr ColumnTable() {
    for (uint32_t set = 0; set < 256; ++set)
      for (uint32_t k = 0; k < 8; ++k) {
        if ((set >> k & 1) == 0) continue;
        ++count[set];
        sum_i[set] = static_cast<uint8_t>(sum_i[set] + k % 4);
        sum_j[set] = static_cast<uint8_t>(sum_j[set] + k / 4);
      }
  }
};

VOXDAG_HD inline const ColumnTable& column_table() {
  static constexpr ColumnTable kTable{};
  return kTable;
}

VOXDAG_HD inline uint32_t count_of(uint32_t columns) {
  return uint32_t{column_table().count[columns & 255]} + column_table().count[columns >> 8];
}

VOXDAG_HD inline ColumnTotals totals_of(uint32_t columns) {
  const ColumnTable& table = column_table();
  const uint32_t low = columns & 255, high = columns >> 8;
  const int64_t high_count = table.count[high];
  return {table.count[low] + high_count, int64_t{table.sum_i[low]} + table.sum_i[high],
          table.sum_j[low] + table.sum_j[high] + 2 * high_count};
}

// Returns the columns (i, j) for which first + a i + b j < 0. Sums that do not fit in Int wrap
// around.
template <class Int>
VOXDAG_HD inline uint32_t negative_columns_one_by_one(Int first, Int a, Int b) {
  uint32_t columns = 0;
  for (uint32_t j = 0; j < 4; ++j, first = wrapping_sum(first, b)) {
    Int at = first;
    for (uint32_t i = 0; i < 4; ++i, at = wrapping_sum(at, a))
      columns |= static_cast<uint32_t>(at < 0) << (4 * j + i);
  }
  return columns;
}

// Does the same as negative_columns_one_by_one(). Uses SSE2, which every x86-64 has, for two
// columns per step.
template <class Int>
VOXDAG_HD inline uint32_t negative_columns(Int first, Int a, Int b) {
#ifdef VOXDAG_SSE2
  if constexpr (sizeof(Int) == 8) {
    const __m128i start = _mm_set_epi64x(wrapping_sum(first, a), first);
    const __m128i two = _mm_set1_epi64x(wrapping_sum(a, a)), down = _mm_set1_epi64x(b);
    __m128i left = start, right = _mm_add_epi64(start, two), rows[4];
    for (int j = 0; j < 4; ++j) {
      // Takes the high halves of the four sums, which contain the signs.
      rows[j] = _mm_castps_si128(
          _mm_shuffle_ps(_mm_castsi128_ps(left), _mm_castsi128_ps(right), 0b11'01'11'01));
      left = _mm_add_epi64(left, down);
      right = _mm_add_epi64(right, down);
    }
    const __m128i signs =
        _mm_packs_epi16(_mm_packs_epi32(rows[0], rows[1]), _mm_packs_epi32(rows[2], rows[3]));
    return static_cast<uint32_t>(_mm_movemask_epi8(signs));
  }
#endif
  return negative_columns_one_by_one(first, a, b);
}

}  // namespace voxdag::color
