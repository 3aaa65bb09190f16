// The columns of bricks that a triangle may touch: shared by the rasterizers for AVX2 and AVX-512.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include "core/backend/cpu/raster/avx2/column_set.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

// `Edges`: the edges in the projection along D.
template <int D, class Edges>
struct Columns {
  const TileTriangle<int32_t>& t;
  int first[3], last[3];  // bricks of the triangle's box
  Edges over;             // undefined if the triangle covers the tile
  ColumnSet plain, edge;  // crossed by no edge, and perhaps by some

  VOXDAG_INLINE explicit Columns(const TileTriangle<int32_t>& triangle) : t(triangle) {
    for (int a = 0; a < 3; ++a) {
      first[a] = t.first_voxel[a] / 4;
      last[a] = t.last_voxel[a] / 4;
    }
    if (t.inside) {
      for (int q = first[Q]; q <= last[Q]; ++q) plain.rows[q] = ColumnSet::bits(first[P], last[P]);
      return;
    }
    over.set(t.edges[D], (D + 1) % 3 == Q);
    over.find_columns(first[P], last[P], first[Q], last[Q], plain, edge);
  }

 private:
  static constexpr int P = kP<D>, Q = kQ<D>;
};

}  // namespace
}  // namespace voxdag::cpu
