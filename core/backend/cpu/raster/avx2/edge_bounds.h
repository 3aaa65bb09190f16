// The edge tests in one projection, as bounds of one coordinate in each row of voxels: edges are
// tested once per row of the tile, not once per column of bricks.
//
// Let k be the coordinate of a row and x the coordinate of a voxel in the row. The voxel is on the
// inner side of an edge iff across k + up x + c >= 0. This is the test of tile_triangle.h: across
// and up are the edge's factors a and b, in this or the reverse order. All values are integers. So
// with t = -(across k + c) and y = (t - 1/2) / |up|, the voxels on the inner side are:
//     up > 0:  x > floor(y)
//     up < 0:  -x > floor(y)
//     up = 0:  no voxel if t > 0, otherwise all. The code divides by 2^-60 instead of |up| = 0, so
//              y is far above or far below all voxels.
// The code computes y = slope k + start in doubles; only the division, products and sums are
// rounded. |across| and |up| are at most 2^27 (tile_triangle.h). t - 1/2 is half-way between
// integers, so y is at least 1 / (2 |up|) >= 2^-28 away from a whole number. The floor of y is
// exact where that matters:
//     |c| <= 2^36:  The error of y is below 2^-12 / |up| + 2^-45, including the error of adding the
//                   constructor's below_more or over_more.
//     |c| > 2^36:   |y| > 2^8 is outside the tile, so only the sign of y matters. The error is
//                   below 1.
//     up = 0:       |y| >= 2^59, and the error is below 2^58, so the sign is correct.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/tile_columns.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

using Edge = TileTriangle<int32_t>::Edge;

VOXDAG_INLINE __m256d load_doubles(const double* at) { return _mm256_load_pd(at); }

// The row numbers 0..63 of a tile as doubles.
struct Doubles {
  alignas(32) double of[64] = {};
  constexpr Doubles() {
    for (int i = 0; i < 64; ++i) of[i] = i;
  }
};
constexpr Doubles kDoubles;

// The coefficients of three edges as doubles, one edge per lane. The fourth lane is unused.
struct EdgeLanes {
  __m256d a, b, c;

  VOXDAG_INLINE explicit EdgeLanes(const Edge (&edges)[3]) {
    static_assert(sizeof(Edge) == 3 * sizeof(int64_t));
    const __m256d first = convert(&edges[0].a);   // a0 b0 c0 a1
    const __m256d second = convert(&edges[1].b);  // b1 c1 a2 b2
    const __m256d third = convert(&edges[1].c);   // c1 a2 b2 c2
    a = _mm256_permute4x64_pd(_mm256_blend_pd(first, second, 0b0100), 0b00'10'11'00);
    b = _mm256_permute4x64_pd(_mm256_blend_pd(first, second, 0b1001), 0b00'11'00'01);
    c = _mm256_permute4x64_pd(_mm256_blend_pd(first, third, 0b1001), 0b00'11'00'10);
  }

 private:
  // Converts integers from -2^51 to 2^51 to doubles. The integers become the low bits of doubles
  // from 2^52 to 2^53.
  static VOXDAG_INLINE __m256d convert(const int64_t* at) {
    const __m256d origin = _mm256_set1_pd(0x1.8p52);
    const __m256i four = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at));
    return _mm256_sub_pd(_mm256_castsi256_pd(_mm256_add_epi64(four, _mm256_castpd_si256(origin))),
                         origin);
  }
};

// The order in which EdgeBounds stores the bounds of three edges: first two that bound x from
// below, then two that bound x from above. lane[set] is this order if bit i of `set` is 1 for each
// edge i that has up < 0 and so bounds x from above. (`up` is the factor of x, see the top of this
// file.)
//
// The order lists lanes of EdgeLanes. Each is a pair of 32-bit lanes, as the permute instruction
// needs them. Lanes 0 to 2 are the edges. A bound without an edge uses lane 3, which excludes
// nothing.
//
// Two bounds per side are enough: the three values of `up` sum to 0, so one or two are negative, or
// all are 0. For an edge with up = 0, both sides give the same result.
struct BoundOrder {
  alignas(32) int32_t lane[8][8] = {};
  constexpr BoundOrder() {
    for (int falling = 0; falling < 8; ++falling) {
      int edges[4] = {3, 3, 3, 3}, below = 0, over = 2;
      for (int edge = 0; edge < 3; ++edge) {
        const bool falls = falling >> edge & 1;
        edges[(falls && over < 4) || below == 2 ? over++ : below++] = edge;
      }
      for (int i = 0; i < 8; ++i) lane[falling][i] = 2 * edges[i / 2] + i % 2;
    }
  }
};
constexpr BoundOrder kBoundOrder;

class EdgeBounds {
 public:
  // If `bound_first` is true, x (the bounded coordinate) has the edges' factor a, and k (the row)
  // has the factor b. Otherwise x has the factor b, and k has the factor a. Adds the whole numbers
  // `below_more` and `over_more` to the values of below() and over(). Callers choose them so that
  // the bounds of voxels in a tile are not negative.
  VOXDAG_INLINE EdgeBounds(const Edge (&edges)[3], bool bound_first, double below_more,
                           double over_more) {
    const EdgeLanes lanes(edges);
    const __m256d up = bound_first ? lanes.a : lanes.b, across = bound_first ? lanes.b : lanes.a;
    const __m256d sign = _mm256_set1_pd(-0.0);
    const __m256d parallel = _mm256_cmp_pd(up, _mm256_setzero_pd(), _CMP_EQ_OQ);
    const __m256d inverse = _mm256_div_pd(
        _mm256_set1_pd(-1.0),
        _mm256_blendv_pd(_mm256_andnot_pd(sign, up), _mm256_set1_pd(0x1p-60), parallel));
    const __m256d half = _mm256_set1_pd(0.5);
    const __m256d slope = _mm256_mul_pd(across, inverse);
    const __m256d start = _mm256_mul_pd(_mm256_add_pd(lanes.c, half), inverse);
    // For widened(): -(1.5 / |up| + (1 + |slope|) / 2).
    const __m256d reach = _mm256_sub_pd(
        _mm256_mul_pd(inverse, _mm256_set1_pd(1.5)),
        _mm256_mul_pd(half, _mm256_add_pd(_mm256_set1_pd(1.0), _mm256_andnot_pd(sign, slope))));
    const __m256i order = _mm256_load_si256(
        reinterpret_cast<const __m256i*>(kBoundOrder.lane[_mm256_movemask_pd(up) & 7]));
    const __m256d slopes = permuted(_mm256_blend_pd(slope, _mm256_setzero_pd(), 0b1000), order);
    const __m256d starts =
        _mm256_add_pd(permuted(_mm256_blend_pd(start, _mm256_set1_pd(-0x1p60), 0b1000), order),
                      _mm256_setr_pd(below_more, below_more, over_more, over_more));
    spread(slopes, slope_);
    spread(starts, start_);
    spread(permuted(_mm256_blend_pd(reach, _mm256_setzero_pd(), 0b1000), order), reach_);
  }

  // Requires bounds for the voxels' centers; returns the bounds for the closed voxels. The integer
  // c of the test for closed voxels exceeds the c of the test for centers by at most 1.5 +
  // (|across| + |up|) / 2. So the returned bounds can be up to 3 / |up| wider than necessary.
  VOXDAG_INLINE EdgeBounds widened() const {
    EdgeBounds out = *this;
    for (int i = 0; i < 4; ++i) out.start_[i] = _mm256_add_pd(start_[i], reach_[i]);
    return out;
  }

  // Return the bounds of x in four rows. Each lane of `k` is the number of a row. y is defined at
  // the top of this file. An edge with up = 0 counts in one of the two functions.
  //   below()  returns below_more + the largest y of the edges with up > 0. So a voxel inside has
  //            x > floor(below() - below_more).
  //   over()   returns over_more + the largest y of the edges with up < 0, which bound -x. So a
  //            voxel inside has -x > floor(over() - over_more).
  VOXDAG_INLINE __m256d below(__m256d k) const {
    return _mm256_max_pd(_mm256_fmadd_pd(slope_[0], k, start_[0]),
                         _mm256_fmadd_pd(slope_[1], k, start_[1]));
  }
  VOXDAG_INLINE __m256d over(__m256d k) const {
    return _mm256_max_pd(_mm256_fmadd_pd(slope_[2], k, start_[2]),
                         _mm256_fmadd_pd(slope_[3], k, start_[3]));
  }

 private:
  static VOXDAG_INLINE __m256d permuted(__m256d x, __m256i order) {
    return _mm256_castps_pd(_mm256_permutevar8x32_ps(_mm256_castpd_ps(x), order));
  }
  static VOXDAG_INLINE void spread(__m256d lanes, __m256d (&out)[4]) {
    out[0] = _mm256_permute4x64_pd(lanes, 0x00);
    out[1] = _mm256_permute4x64_pd(lanes, 0x55);
    out[2] = _mm256_permute4x64_pd(lanes, 0xaa);
    out[3] = _mm256_permute4x64_pd(lanes, 0xff);
  }

  __m256d slope_[4], start_[4], reach_[4];
};

}  // namespace
}  // namespace voxdag::cpu
