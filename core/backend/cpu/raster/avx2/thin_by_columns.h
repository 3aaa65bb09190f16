// The rasterizer of the rule kThin for AVX2 and AVX-512. Like draw_by_columns.h, it visits columns
// of bricks along the axis D of the normal's largest component. In each voxel column, exactly one
// voxel passes the plane test along D (thin_triangle.h). This voxel is set if
//
//   - the row along D through the column's center crosses the triangle (Footprint::inside), or
//   - the voxel passes the plane test and the edge tests along one of the other axes.
//
// The second condition only matters where the first one fails, which is near the triangle's edges.
// This voxel is the only one of its column that the triangle can set. So the tests along the other
// axes do not compute heights: the voxel is set if their bounds leave any voxel of the column.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/draw_by_columns.h"

namespace voxdag::cpu {
namespace {

// Tests a triangle along an axis other than D (thin_triangle.h). Finds the voxel columns in which a
// voxel passes both the plane test and the edge tests along this axis.
template <int D>
class SideCrossings {
 public:
  VOXDAG_INLINE SideCrossings(const ThinTriangle<int32_t>& t, int axis)
      : heights(t.normal, t.lowest_along[axis], t.width_along[axis]) {}

  // Returns a mask of the voxel columns of `at` that have a voxel within the bounds of the plane
  // and within `sides`. The mask has the layout of HeightBounds (sides.h); both bytes of such a
  // column are all ones.
  VOXDAG_INLINE __m256i hits(const typename Heights<D>::Column& at, HeightBounds sides) const {
    const HeightBounds bounds =
        _mm256_max_epu8(heights.bounds(heights.in_bricks_of(at), _mm256_setzero_si256()), sides);
    const __m256i sum = _mm256_adds_epu8(bounds, _mm256_shuffle_epi32(bounds, 0b01'00'11'10));
    return _mm256_cmpeq_epi8(_mm256_min_epu8(sum, _mm256_set1_epi8(kMaxHeight - 1)), sum);
  }

 private:
  const Heights<D> heights;
};

template <int D, class Spread>
class ThinColumnWalk {
 public:
  VOXDAG_INLINE ThinColumnWalk(const ThinTriangle<int32_t>& triangle, TileBricks& bricks)
      : t(triangle),
        tile(bricks),
        footprint(triangle, FootprintColumns::kTouched),
        heights(triangle.normal, triangle.lowest, triangle.width) {}

  VOXDAG_INLINE void run() {
    const int first = t.first_voxel[D] / 4, last = t.last_voxel[D] / 4;
    if (t.inside) {
      footprint.columns.for_each([ =, this ](int number) __attribute__((always_inline)) {
        const auto at = heights.column(number & 15, number >> 4, first, last);
        if (at.from <= at.to) set(number, at, heights.bounds(at, _mm256_setzero_si256()));
      });
    } else {
      sides.set(t);
      const SideCrossings<D> along_p(t, kP<D>), along_q(t, kQ<D>);
      footprint.columns.for_each([&](int number) __attribute__((always_inline)) {
        const int p = number & 15, q = number >> 4;
        const auto at = heights.column(p, q, first, last);
        if (at.from > at.to) return;
        HeightBounds bounds = heights.bounds(at, _mm256_setzero_si256());
        const uint16_t inside = footprint.inside[q][p];
        if (inside != 0xffff) {
          const __m256i hits = _mm256_or_si256(along_p.hits(at, sides.bounds_of_q(q, at.brick)),
                                               along_q.hits(at, sides.bounds_of_p(p, at.brick)));
          bounds =
              _mm256_max_epu8(bounds, _mm256_andnot_si256(_mm256_or_si256(hits, columns_of(inside)),
                                                          _mm256_set1_epi8(kNothing)));
        }
        set(number, at, bounds);
      });
    }
  }

 private:
  static constexpr int8_t kNothing = 120;  // as a bound, excludes all voxels

  // Returns a vector with the layout of HeightBounds. The bytes of the voxel columns in `inside` (a
  // set as in Footprint::inside) are all ones, and all other bytes are 0.
  static VOXDAG_INLINE __m256i columns_of(uint16_t inside) {
    const __m256i bits = load(kInsideBits.bit);
    const __m256i lanes = _mm256_cmpeq_epi16(
        _mm256_and_si256(_mm256_set1_epi16(static_cast<int16_t>(inside)), bits), bits);
    return _mm256_packs_epi16(lanes, lanes);
  }

  VOXDAG_INLINE void set(int number, const typename Heights<D>::Column& at, HeightBounds bounds) {
    const Spread spread(bounds);
    const uint32_t index = kBrickIndex<D>.of_column[number];
    for (int64_t z = at.from; z <= at.to; ++z)
      tile.add(index | kBrickIndex<D>.of_height[z], spread.mask(z - at.brick));
  }

  const ThinTriangle<int32_t>& t;
  TileBricks& tile;
  const Footprint<D> footprint;
  const Heights<D> heights;
  Sides<D> sides;
};

template <int D, class Spread>
VOXDAG_INLINE void draw_thin_along(const ThinTriangle<int32_t>& t, TileBricks& tile) {
  if ((t.normal[kP<D>] | t.normal[kQ<D>]) == 0)
    draw_flat<D>(t, tile);
  else
    ThinColumnWalk<D, Spread>(t, tile).run();
}

// Draws a triangle. For Spread, see draw_by_columns().
template <template <int> class Spread>
VOXDAG_INLINE void draw_thin_by_columns(const ThinTriangle<int32_t>& t, TileBricks& tile) {
  if (t.dominant == 0)
    draw_thin_along<0, Spread<0>>(t, tile);
  else if (t.dominant == 1)
    draw_thin_along<1, Spread<1>>(t, tile);
  else
    draw_thin_along<2, Spread<2>>(t, tile);
}

}  // namespace
}  // namespace voxdag::cpu
