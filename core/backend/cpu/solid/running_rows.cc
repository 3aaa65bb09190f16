#include "core/backend/cpu/solid/running_rows.h"

#include "core/geometry/cube.h"

namespace voxdag::cpu {

RunningRows::RunningRows(PooledMemory& memory, const SolidEntry& entry, int tiles, int blocks)
    : tiles_(static_cast<size_t>(tiles)),
      blocks_(blocks),
      views_(memory, 3 * tiles_ * tiles_ * kSquare, PooledArray<int32_t>::kZero) {
  const int stride = tiles * blocks + 1;
  size_t at = 0;
  for (const auto& rows : entry.views)
    for (int f = 0; f < tiles; ++f)
      for (int s = 0; s < tiles; ++s, at += kSquare)
        for (int i = 0; i <= blocks; ++i)
          for (int j = 0; j <= blocks; ++j)
            views_[at + static_cast<size_t>(kRows * i + j)] =
                rows[static_cast<size_t>((f * blocks + i) * stride + s * blocks + j)];
}

UnitViews RunningRows::corners_of(const int (&low)[3], int edge) {
  UnitViews unit;
  for (int c = 0; c < 8; ++c) {
    int tile[3], row[3];
    for (int a = 0; a < 3; ++a) {
      const bool is_high = child_coordinate(c, a) != 0;
      tile[a] = low[a] + (is_high ? edge - 1 : 0);
      row[a] = is_high ? blocks_ : 0;
    }
    int64_t views = 0;
    for (int a = 0; a < 3; ++a)
      views += column(a, tile)[kRows * row[first_row_axis(a)] + row[second_row_axis(a)]];
    unit.add(views);
  }
  return unit;
}

}  // namespace voxdag::cpu
