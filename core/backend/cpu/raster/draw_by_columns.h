// What the rasterizers for AVX2 and AVX-512 have in common: the axis that columns run along, and
// triangles across it. Of its own each has
//   EdgeColumns<D>   Columns, with for_each_inner(visit), which calls visit(number, inner) for each
//                    column of bricks that edges cross, `inner` a bit per voxel column inside
//   ColumnWalk<D>    whose run() draws a triangle column by column
//
// Only included by sources compiled for AVX2 and BMI2; all of it has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/columns_avx2.h"
#include "core/backend/cpu/raster/draw_portable.h"

namespace voxdag::cpu {
namespace {

// A triangle across D, in one layer of voxels: their columns are all that matters.
template <int D, class EdgeColumns>
VOXDAG_INLINE void draw_flat(const TileTriangle<int32_t>& t, TileBricks& tile) {
  const EdgeColumns columns(t);
  const int z = t.first_voxel[D];
  const uint32_t at_height = kBrickIndex<D>.of_height[z / 4];
  const uint64_t layer = kLayers.voxels[D][z % 4];
  columns.for_each_inner([&](int number, uint32_t inner) __attribute__((always_inline)) {
    if constexpr (kP < D >> kQ<D>) inner = transposed(inner);
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
