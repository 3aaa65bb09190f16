#include "core/backend/cpu/raster/tile_triangle.h"

#include <algorithm>

namespace voxdag::cpu {

template <class Coordinate>
bool TileTriangle<Coordinate>::set_up(const Triangle<Coordinate>& triangle, bool is_inside,
                                      const LatticeCube& tile) {
  inside = is_inside;
  int64_t v[3][3], half[3][3];
  if (!set_box(triangle, tile, v)) return false;
  set_halves(v, half);
  if (!set_plane(v, half, tile.edge >> kUnitBits)) return false;
  if (!inside) set_edges(v, half);
  return true;
}

template <class Coordinate>
bool TileTriangle<Coordinate>::set_box(const Triangle<Coordinate>& triangle,
                                       const LatticeCube& tile, int64_t (&v)[3][3]) {
  for (int a = 0; a < 3; ++a) {
    for (int i = 0; i < 3; ++i) v[a][i] = triangle.v[a][i] - tile.low[a];
    const int64_t last = (tile.edge >> kUnitBits) - 1;
    const int64_t low = std::max<int64_t>(std::min({v[a][0], v[a][1], v[a][2]}) >> kUnitBits, 0);
    const int64_t high = std::min(std::max({v[a][0], v[a][1], v[a][2]}) >> kUnitBits, last);
    if (low > high) return false;
    first_voxel[a] = static_cast<int>(low);
    last_voxel[a] = static_cast<int>(high);
  }
  return true;
}

template <class Coordinate>
void TileTriangle<Coordinate>::set_halves(const int64_t (&v)[3][3], int64_t (&half)[3][3]) {
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) half[a][i] = (v[a][i == 2 ? 0 : i + 1] - v[a][i]) / 2;
}

template <class Coordinate>
void TileTriangle<Coordinate>::set_normal(int64_t (&half)[3][3], Int (&size)[3]) {
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    normal[a] =
        static_cast<Int>(half[b][0]) * half[c][1] - static_cast<Int>(half[c][0]) * half[b][1];
  }
  for (int a = 0; a < 3; ++a) size[a] = normal[a] < 0 ? -normal[a] : normal[a];
  dominant = size[1] > size[0] ? 1 : 0;
  if (size[2] > size[dominant]) dominant = 2;
  if (normal[dominant] < 0) {
    // Also negates the half-edges. set_edges() multiplies them by the sign of the normal, so the
    // edges remain the same.
    for (int a = 0; a < 3; ++a) {
      normal[a] = -normal[a];
      for (int i = 0; i < 3; ++i) half[a][i] = -half[a][i];
    }
  }
}

template <class Coordinate>
bool TileTriangle<Coordinate>::set_plane(const int64_t (&v)[3][3], int64_t (&half)[3][3],
                                         int64_t tile_voxels) {
  Int size[3];
  set_normal(half, size);
  int128 c = 0;
  for (int a = 0; a < 3; ++a) c -= static_cast<int128>(normal[a]) * v[a][0];
  const Int rising = positive_part(normal[0]) + positive_part(normal[1]) + positive_part(normal[2]);
  const Int total = size[0] + size[1] + size[2];
  width = total - ((c & (kUnitsPerVoxel - 1)) != 0 ? 1 : 0);
  const int128 base = (c >> kUnitBits) + rising;
  const int128 span = tile_voxels - 1;
  if (base + span * rising < 0 || base - span * (total - rising) > width) return false;
  lowest = static_cast<Int>(base);
  return true;
}

template <class Coordinate>
void TileTriangle<Coordinate>::set_edges(const int64_t (&v)[3][3], const int64_t (&half)[3][3]) {
  constexpr int64_t kClamp = int64_t{1} << 60;
  for (int d = 0; d < 3; ++d) {
    const int p = (d + 1) % 3, q = (d + 2) % 3;
    // If set_normal() has negated the half-edges, it has also negated the normal, and therefore
    // `sign`. So a and b are the same in both cases.
    const int64_t sign = normal[d] < 0 ? -1 : 1;
    for (int i = 0; i < 3; ++i) {
      const int64_t a = -half[q][i] * sign, b = half[p][i] * sign;
      const Int c = -(static_cast<Int>(a) * v[p][i] + static_cast<Int>(b) * v[q][i]);
      Int floored = c >> kUnitBits;
      if constexpr (!kNarrow) floored = std::clamp<Int>(floored, -kClamp, kClamp);
      edges[d][i] = {
          a, b, static_cast<int64_t>(floored) + std::max<int64_t>(a, 0) + std::max<int64_t>(b, 0)};
    }
  }
}

template struct TileTriangle<int32_t>;
template struct TileTriangle<int64_t>;

}  // namespace voxdag::cpu
