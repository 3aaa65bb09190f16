// The common part of the rasterizers for AVX2 and AVX-512: the choice of the columns' axis, and
// triangles perpendicular to it. Each rasterizer supplies
//   EdgeColumns<D>   Columns, with for_each_inner(visit), which calls visit(number, inner) for each
//                    column of bricks that edges cross, `inner` having a bit per voxel column
//                    inside
//   ColumnWalk<D>    whose run() draws a triangle column by column
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/column_set.h"
#include "core/backend/cpu/raster/kernels.h"

namespace voxdag::cpu {
namespace {

// The columns of bricks that a triangle may touch. `Edges`: the edges in the projection along D.
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

// Draws a triangle perpendicular to D: one layer of voxels, which only the edges bound.
template <int D, class EdgeColumns>
VOXDAG_INLINE void draw_flat(const TileTriangle<int32_t>& t, TileBricks& tile) {
  // The voxels of a layer are numbered with the axis of the larger index first.
  constexpr bool kTranspose = (kP<D>) < (kQ<D>);
  const EdgeColumns columns(t);
  const int z = t.first_voxel[D];
  const uint32_t at_height = kBrickIndex<D>.of_height[z / 4];
  const uint64_t layer = kLayers.voxels[D][z % 4];
  columns.for_each_inner([&](int number, uint32_t inner) __attribute__((always_inline)) {
    if constexpr (kTranspose) inner = transposed(inner);
    tile.add(kBrickIndex<D>.of_column[number] | at_height, _pdep_u64(inner, layer));
  });
  columns.plain.for_each([&](int number) __attribute__((always_inline)) {
    tile.add(kBrickIndex<D>.of_column[number] | at_height, layer);
  });
}

template <int D, class EdgeColumns, class ColumnWalk>
VOXDAG_INLINE void draw_along(const TileTriangle<int32_t>& t, TileBricks& tile) {
  if ((t.normal[kP<D>] | t.normal[kQ<D>]) == 0)
    draw_flat<D, EdgeColumns>(t, tile);
  else
    ColumnWalk(t, tile).run();
}

template <template <int> class EdgeColumns, template <int> class ColumnWalk>
VOXDAG_INLINE void draw_by_columns(const TileTriangle<int32_t>& t, TileBricks& tile) {
  if (t.normal[t.dominant] == 0) return draw_exactly(t, tile);
  if (t.dominant == 0)
    draw_along<0, EdgeColumns<0>, ColumnWalk<0>>(t, tile);
  else if (t.dominant == 1)
    draw_along<1, EdgeColumns<1>, ColumnWalk<1>>(t, tile);
  else
    draw_along<2, EdgeColumns<2>, ColumnWalk<2>>(t, tile);
}

}  // namespace
}  // namespace voxdag::cpu
