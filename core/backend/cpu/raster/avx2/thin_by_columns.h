// The rasterizer of the rule kThin for AVX2 and AVX-512. Like draw_by_columns.h, it visits columns
// of bricks along the axis D of the normal's largest component. In each voxel column, exactly one
// voxel passes the plane test along D (thin_triangle.h). This voxel is set if
//
//   - the row along D through the column's center crosses the triangle (Footprint::inside), or
//   - the voxel passes the plane test and the edge tests along one of the other axes.
//
// The second condition only matters where the first one fails, which is near the triangle's edges.
// This voxel is the only one of its column that the triangle can set. So the tests along the other
// axes compute no further heights. Their plane tests are ranges of the distance from the plane to
// the voxel, which is the fraction of the column's lane (heights.h).
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/draw_by_columns.h"

namespace voxdag::cpu {
namespace {

// The plane test of a triangle along an axis other than D (thin_triangle.h).
//
// Let z be the voxel of a voxel column that passes the plane test along D, and y the plane's height
// (heights.h). With Y = y - z + 1 voxel, which is above 0 and at most 1 voxel, z passes the plane
// test along this axis iff
//     first <= Y <= last    with last = 1 + (lowest_along[axis] - lowest) / n_D  and
//                                first = last - width_along[axis] / n_D
// The fraction x of the lane `below` is in (Y - 2.02, Y - 0.02], in units of the lane. So it
// decides the test, except for up to three values at each end of the range.
class SidePlane {
 public:
  VOXDAG_INLINE SidePlane(const ThinTriangle<int32_t>& t, int axis) {
    const int64_t width = t.width_along[axis];
    const double unit = (1 << kHeightBits) / static_cast<double>(t.normal[t.dominant]);
    const double last =
        (1 << kHeightBits) + static_cast<double>(t.lowest_along[axis] - t.lowest) * unit;
    const double first = last - static_cast<double>(width) * unit;
    // No x is above 2^13.
    before_certain_ = set1(width < 0 ? 1 << 13 : ceil_of(first - 0.01) - 1);
    before_possible_ = set1(width < 0 ? 1 << 13 : ceil_of(first - 2.03) - 1);
    last_certain_ = set1(floor_of(last - 2.03));
    last_possible_ = set1(floor_of(last - 0.01));
  }

  // Return the lanes whose fraction x certainly passes the test, or may pass it.
  VOXDAG_INLINE __m256i certain(__m256i x) const {
    return _mm256_andnot_si256(_mm256_cmpgt_epi16(x, last_certain_),
                               _mm256_cmpgt_epi16(x, before_certain_));
  }
  VOXDAG_INLINE __m256i possible(__m256i x) const {
    return _mm256_andnot_si256(_mm256_cmpgt_epi16(x, last_possible_),
                               _mm256_cmpgt_epi16(x, before_possible_));
  }

 private:
  // For numbers from -2^12 to 2^14.
  static VOXDAG_INLINE int floor_of(double x) { return static_cast<int>(x + 4096) - 4096; }
  static VOXDAG_INLINE int ceil_of(double x) { return -(static_cast<int>(16384 - x) - 16384); }
  static VOXDAG_INLINE __m256i set1(int x) { return _mm256_set1_epi16(static_cast<int16_t>(x)); }

  __m256i before_certain_, before_possible_, last_certain_, last_possible_;
};

// Finds the voxel columns in which a voxel passes both the plane test and the edge tests along axis
// P or along axis Q.
template <int D>
class SideCrossings {
 public:
  VOXDAG_INLINE explicit SideCrossings(const ThinTriangle<int32_t>& triangle)
      : t(triangle), along_p(triangle, kP<D>), along_q(triangle, kQ<D>) {}

  // Returns a mask of these voxel columns in the column of bricks `at`, with the layout of
  // HeightBounds (sides.h); both bytes of such a voxel column are all ones. `lanes` and `bounds`
  // are the column's heights. The result has any value for the voxel columns in `decided`, which
  // has all ones in their 16-bit lanes.
  VOXDAG_INLINE __m256i hits(const typename Heights<D>::Column& at,
                             const typename Heights<D>::Lanes& lanes, HeightBounds bounds,
                             const Sides<D>& sides, __m256i decided) const {
    const HeightBounds of_q = sides.bounds_of_q(at.q, at.brick),
                       of_p = sides.bounds_of_p(at.p, at.brick);
    const __m256i x = _mm256_and_si256(lanes.below, _mm256_set1_epi16((1 << kHeightBits) - 1));
    const __m256i p = along_p.certain(x), q = along_q.certain(x);
    const __m256i doubt = _mm256_or_si256(_mm256_xor_si256(p, along_p.possible(x)),
                                          _mm256_xor_si256(q, along_q.possible(x)));
    if (lanes.is_corrected || !_mm256_testc_si256(decided, doubt)) [[unlikely]]
      return exact_hits(at, of_q, of_p);
    return _mm256_or_si256(hits_along(p, bounds, of_q), hits_along(q, bounds, of_p));
  }

 private:
  // `bounds` leave one voxel of each voxel column. Returns the voxel columns in `plane` of which
  // `sides` do not exclude this voxel.
  static VOXDAG_INLINE __m256i hits_along(__m256i plane, HeightBounds bounds, HeightBounds sides) {
    const __m256i within = _mm256_cmpeq_epi8(_mm256_max_epu8(bounds, sides), bounds);
    const __m256i both = _mm256_and_si256(within, _mm256_packs_epi16(plane, plane));
    return _mm256_and_si256(both, _mm256_shuffle_epi32(both, 0b01'00'11'10));
  }
  // Does the same as hits(), by the heights of the planes along the two axes.
  [[gnu::noinline]] __m256i exact_hits(const typename Heights<D>::Column& at, HeightBounds of_q,
                                       HeightBounds of_p) const {
    return _mm256_or_si256(exact_hits_along(kP<D>, at, of_q), exact_hits_along(kQ<D>, at, of_p));
  }
  VOXDAG_INLINE __m256i exact_hits_along(int axis, const typename Heights<D>::Column& at,
                                         HeightBounds sides) const {
    const Heights<D> heights(t.normal, t.lowest_along[axis], t.width_along[axis]);
    const HeightBounds bounds =
        _mm256_max_epu8(heights.bounds(heights.in_bricks_of(at), _mm256_setzero_si256()), sides);
    const __m256i sum = _mm256_adds_epu8(bounds, _mm256_shuffle_epi32(bounds, 0b01'00'11'10));
    return _mm256_cmpeq_epi8(_mm256_min_epu8(sum, _mm256_set1_epi8(kMaxHeight - 1)), sum);
  }

  const ThinTriangle<int32_t>& t;
  const SidePlane along_p, along_q;
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
    footprint.full.for_each([ =, this ](int number) __attribute__((always_inline)) {
      const auto at = heights.column(number & 15, number >> 4, first, last);
      if (at.from <= at.to) set(number, at, heights.bounds(at, _mm256_setzero_si256()));
    });
    if (footprint.columns.count == 0) return;
    sides.set(t);
    const SideCrossings<D> crossings(t);
    footprint.columns.for_each([&](int number) __attribute__((always_inline)) {
      const int p = number & 15, q = number >> 4;
      const auto at = heights.column(p, q, first, last);
      if (at.from > at.to) return;
      const auto lanes = heights.lanes(at);
      const HeightBounds bounds = heights.bounds_of(lanes);
      const __m256i columns = columns_of(footprint.inside[q][p]);
      const __m256i hits = _mm256_or_si256(crossings.hits(at, lanes, bounds, sides, columns),
                                           _mm256_packs_epi16(columns, columns));
      const __m256i nothing = _mm256_andnot_si256(hits, _mm256_set1_epi8(kNothing));
      set(number, at, _mm256_max_epu8(bounds, nothing));
    });
  }

 private:
  static constexpr int8_t kNothing = 120;  // as a bound, excludes all voxels

  // Returns a vector with a 16-bit lane for each voxel column. The lanes of the voxel columns in
  // `inside` (a set as in Footprint::inside) are all ones, and all other lanes are 0.
  static VOXDAG_INLINE __m256i columns_of(uint16_t inside) {
    const __m256i bits = load(kInsideBits.bit);
    return _mm256_cmpeq_epi16(
        _mm256_and_si256(_mm256_set1_epi16(static_cast<int16_t>(inside)), bits), bits);
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
