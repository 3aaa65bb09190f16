#include "core/backend/cpu/raster/thin_triangle.h"

#include <algorithm>

namespace voxdag::cpu {
namespace {

constexpr int64_t kHalfVoxel = kUnitsPerVoxel / 2;

}  // namespace

template <class Coordinate>
bool ThinTriangle<Coordinate>::set_up(const Triangle<Coordinate>& triangle, bool is_inside,
                                      const LatticeCube& tile) {
  this->inside = is_inside;
  int64_t v[3][3], half[3][3];
  if (!this->set_box(triangle, tile, v)) return false;
  TileTriangle<Coordinate>::set_halves(v, half);
  Int size[3];
  this->set_normal(half, size);
  if (size[this->dominant] == 0 || !set_planes(v, size, tile.edge >> kUnitBits)) return false;
  if (!is_inside) set_rows(v, half);
  return true;
}

template <class Coordinate>
bool ThinTriangle<Coordinate>::set_planes(const int64_t (&v)[3][3], const Int (&size)[3],
                                          int64_t tile_voxels) {
  const auto& n = this->normal;
  // A value n.(p - v0) of 0 counts as having the sign of the normal's first component that is not
  // 0. If this component is negative, subtracting 1 makes the value negative.
  int128 origin = (n[0] != 0 ? n[0] : n[1] != 0 ? n[1] : n[2]) < 0 ? -1 : 0;
  for (int a = 0; a < 3; ++a) origin -= static_cast<int128>(n[a]) * v[a][0];
  const auto lowest_of = [&](int a) {
    const Int across = n[(a + 1) % 3] + n[(a + 2) % 3];
    return ((origin + static_cast<int128>(across) * kHalfVoxel) >> kUnitBits) +
           this->positive_part(n[a]);
  };
  const int up = this->dominant;
  const int128 base = lowest_of(up), span = tile_voxels - 1;
  const Int rising =
      this->positive_part(n[0]) + this->positive_part(n[1]) + this->positive_part(n[2]);
  const Int falling = rising - (size[0] + size[1] + size[2]);
  if (base + span * rising < 0 || base + span * falling >= size[up]) return false;
  for (int a = 0; a < 3; ++a) {
    lowest_along[a] = static_cast<Int>(a == up ? base : lowest_of(a));
    width_along[a] = size[a] - 1;
  }
  this->lowest = lowest_along[up];
  this->width = width_along[up];
  return true;
}

template <class Coordinate>
void ThinTriangle<Coordinate>::set_rows(const int64_t (&v)[3][3], const int64_t (&half)[3][3]) {
  constexpr int64_t kClamp = int64_t{1} << 60;
  for (int d = 0; d < 3; ++d) {
    const int p = (d + 1) % 3, q = (d + 2) % 3;
    const int64_t sign = this->normal[d] < 0 ? -1 : 1;
    for (int i = 0; i < 3; ++i) {
      const int64_t a = -half[q][i] * sign, b = half[p][i] * sign;
      // The value of an edge's function at a row has no sign if it is 0. It then counts as having
      // the sign of the factor of the first axis (in the order x, y, z) or, if this factor is 0, of
      // the other factor.
      const int64_t first = p < q ? a : b, second = p < q ? b : a;
      const bool inside_at_zero = first != 0 ? first > 0 : second > 0;
      const Int c = static_cast<Int>(a) * (kHalfVoxel - v[p][i]) +
                    static_cast<Int>(b) * (kHalfVoxel - v[q][i]) - (inside_at_zero ? 0 : 1);
      Int floored = c >> kUnitBits;
      if constexpr (!TileTriangle<Coordinate>::kNarrow)
        floored = std::clamp<Int>(floored, -kClamp, kClamp);
      this->edges[d][i] = {a, b, static_cast<int64_t>(floored)};
    }
  }
}

template struct ThinTriangle<int32_t>;
template struct ThinTriangle<int64_t>;

}  // namespace voxdag::cpu
