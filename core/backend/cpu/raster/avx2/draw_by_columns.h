// The rasterizer for AVX2 and AVX-512. It visits the bricks in columns along the axis of the
// normal's largest component; the coordinate along this axis is called the height. A column of
// bricks consists of 4 x 4 voxel columns. The plane crosses each voxel column within a few voxels
// of height.
//
//   1. For each row of voxels of the tile, the edges give bounds in the three projections. The
//      projection along the columns gives the voxel columns inside (footprint.h), and the two
//      other projections give bounds of the heights (sides.h).
//   2. For all 16 voxel columns of a column of bricks in one step, the plane gives the lowest and
//      highest voxel that it touches in each voxel column (heights.h). The bounds of step 1 limit
//      these heights.
//   3. The heights become one bit per voxel of each brick. This step is the only difference between
//      the rasterizers for AVX2 and AVX-512.
//
// No branch depends on which edges cross a column of bricks, because the CPU would mispredict such
// a branch. A triangle perpendicular to an axis touches one layer of voxels, so it needs no
// heights.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/footprint.h"
#include "core/backend/cpu/raster/avx2/heights.h"
#include "core/backend/cpu/raster/avx2/sides.h"
#include "core/backend/cpu/raster/avx2/tile_columns.h"
#include "core/backend/cpu/raster/kernels.h"

namespace voxdag::cpu {
namespace {

// bit[i] is the bit of voxel column i in Footprint::inside. Loaded as a vector, the array has a
// 16-bit lane for each voxel column.
struct InsideBits {
  alignas(32) uint16_t bit[16] = {};
  constexpr InsideBits() {
    for (int i = 0; i < 16; ++i)
      bit[i] = static_cast<uint16_t>(1 << (column_p(i) + 4 * column_q(i)));
  }
};
constexpr InsideBits kInsideBits;

template <int D, class Spread>
class ColumnWalk {
 public:
  VOXDAG_INLINE ColumnWalk(const TileTriangle<int32_t>& triangle, TileBricks& bricks)
      : t(triangle),
        tile(bricks),
        footprint(triangle, FootprintColumns::kInside),
        heights(triangle.normal, triangle.lowest, triangle.width) {}

  VOXDAG_INLINE void run() {
    const int first = t.first_voxel[D] / 4, last = t.last_voxel[D] / 4;
    if (t.inside) {
      footprint.columns.for_each([ =, this ](int number) __attribute__((always_inline)) {
        column<false>(number, first, last);
      });
    } else {
      sides.set(t);
      footprint.columns.for_each([ =, this ](int number) __attribute__((always_inline)) {
        column<true>(number, first, last);
      });
    }
  }

 private:
  template <bool Edges>
  VOXDAG_INLINE void column(int number, int first, int last) {
    const int p = number & 15, q = number >> 4;
    const auto at = heights.column(p, q, first, last);
    if (at.from > at.to) return;
    __m256i outer = _mm256_setzero_si256();
    if constexpr (Edges) {
      const __m256i columns = _mm256_set1_epi16(static_cast<int16_t>(footprint.inside[q][p]));
      outer = _mm256_cmpeq_epi16(_mm256_and_si256(columns, load(kInsideBits.bit)), outer);
    }
    HeightBounds bounds = heights.bounds(at, outer);
    if constexpr (Edges) bounds = _mm256_max_epu8(bounds, sides.bounds(p, q, at.brick));
    const Spread spread(bounds);
    const uint32_t index = kBrickIndex<D>.of_column[number];
    for (int64_t z = at.from; z <= at.to; ++z)
      tile.add(index | kBrickIndex<D>.of_height[z], spread.mask(z - at.brick));
  }

  const TileTriangle<int32_t>& t;
  TileBricks& tile;
  const Footprint<D> footprint;
  const Heights<D> heights;
  Sides<D> sides;
};

// Converts a set of the 16 voxel columns of a column of bricks, in which column (p, q) has bit p +
// 4 q. Returns the voxels that these columns have in one layer of a brick, as 16 bits in Morton
// order.
template <int D>
VOXDAG_INLINE uint32_t in_layer(uint32_t columns) {
  const uint32_t middle = (columns >> 2 ^ columns) & 0x0c0c;
  columns ^= middle | middle << 2;
  // In Morton order, the axis with the larger index has the lower bits.
  return kP<D> < kQ<D> ? transposed(columns) : columns;
}

// Draws a triangle whose plane is perpendicular to axis D. All its voxels are in one layer, so only
// the edge tests decide which voxels of the layer are set.
template <int D>
VOXDAG_INLINE void draw_flat(const TileTriangle<int32_t>& t, TileBricks& tile) {
  const Footprint<D> footprint(t, FootprintColumns::kInside);
  const int z = t.first_voxel[D];
  const uint32_t at_height = kBrickIndex<D>.of_height[z / 4];
  const uint64_t layer = kLayers.voxels[D][z % 4];
  footprint.columns.for_each([&](int number) __attribute__((always_inline)) {
    const uint32_t inside = in_layer<D>(footprint.inside[number >> 4][number & 15]);
    tile.add(kBrickIndex<D>.of_column[number] | at_height, _pdep_u64(inside, layer));
  });
}

template <int D, class Spread>
VOXDAG_INLINE void draw_along(const TileTriangle<int32_t>& t, TileBricks& tile) {
  if ((t.normal[kP<D>] | t.normal[kQ<D>]) == 0)
    draw_flat<D>(t, tile);
  else
    ColumnWalk<D, Spread>(t, tile).run();
}

// Draws a triangle. Spread<D> converts the HeightBounds (sides.h) of a column of bricks to voxels.
// Its mask(up) is the set of touched voxels of one brick. `up`, from 0 to 3, counts bricks upward
// from the brick at whose floor HeightBounds has height 0.
template <template <int> class Spread>
VOXDAG_INLINE void draw_by_columns(const TileTriangle<int32_t>& t, TileBricks& tile) {
  if (t.normal[t.dominant] == 0) return draw_exactly(t, tile);
  if (t.dominant == 0)
    draw_along<0, Spread<0>>(t, tile);
  else if (t.dominant == 1)
    draw_along<1, Spread<1>>(t, tile);
  else
    draw_along<2, Spread<2>>(t, tile);
}

}  // namespace
}  // namespace voxdag::cpu
