#include "core/backend/cpu/solid/tile_views.h"

#include <cstring>

#include "core/geometry/cube.h"

namespace voxdag::cpu {

void TileViews::begin(const SampleRows& rows) { rows_ = rows; }

void TileViews::add(const FixedTriangle& triangle) {
  const int64_t edge = int64_t{rows_.blocks} << rows_.pitch_log2;
  for (int a = 0; a < 3; ++a) {
    if (triangle.high(a) < rows_.low[a] || triangle.low(a) > rows_.low[a] + edge) continue;
    rows_.for_each_crossing(triangle, a, [&](int i, int j, int64_t k, int sign) {
      if (k < 0 || k >= rows_.blocks) return;
      crossings_[a][k][RunningRows::kRows * i + j] += sign;
      has_crossings_[a] = true;
    });
  }
}

void TileViews::finish(SolidRule rule, RunningRows& running, const int (&tile)[3]) {
  std::memset(views_, 0, sizeof views_);
  for (int a = 0; a < 3; ++a) {
    int32_t* const rows = running.column(a, tile);
    for (int k = 0; k <= rows_.blocks; ++k) {
      add_views(a, k, rows);
      if (k == rows_.blocks || !has_crossings_[a]) continue;
      for (int row = 0; row < RunningRows::kSquare; ++row)
        rows[row] = view_after(rule, rows[row], crossings_[a][k][row]);
    }
    if (has_crossings_[a]) std::memset(crossings_[a], 0, sizeof crossings_[a]);
    has_crossings_[a] = false;
  }
}

void TileViews::add_views(int axis, int k, const int32_t* rows) {
  constexpr int n = kCorners;
  if (axis == 0) {
    for (int row = 0; row < n * n; ++row) (&views_[k][0][0])[row] += rows[row];
  } else if (axis == 1) {
    for (int x = 0; x < n; ++x)
      for (int z = 0; z < n; ++z) views_[x][k][z] += rows[n * x + z];
  } else {
    for (int x = 0; x < n; ++x)
      for (int y = 0; y < n; ++y) views_[x][y][k] += rows[n * x + y];
  }
}

UnitViews TileViews::corners_of(const int (&low)[3], int edge) const {
  UnitViews unit;
  for (int c = 0; c < 8; ++c)
    unit.add(at(low[0] + child_coordinate(c, 0) * edge, low[1] + child_coordinate(c, 1) * edge,
                low[2] + child_coordinate(c, 2) * edge));
  return unit;
}

}  // namespace voxdag::cpu
