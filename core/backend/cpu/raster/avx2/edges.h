// Edge tests of the AVX2 rasterizer (draw.cc), for columns of bricks and for 16 voxel columns at
// once.
//
// 32 bits suffice for voxel columns: |a|, |b| <= 2^27, so over a brick an edge's value differs by
// at most 3 (|a| + |b|) < 2^30 from its largest, which is computed in 64 bits and clamped to 2^30.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/column_set.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

using Edge = TileTriangle<int32_t>::Edge;

constexpr int64_t kEdgeClamp = int64_t{1} << 30;

VOXDAG_INLINE int64_t above_zero(int64_t a) { return a > 0 ? a : 0; }
VOXDAG_INLINE int64_t magnitude(int64_t a) { return a < 0 ? -a : a; }

// For each of 16 voxel columns p + 2 q (low bits of p, q) + 4 p + 8 q (high bits), in two vectors,
// the difference between an edge's value and its largest over the columns: columns 0-3, 8-11 and
// 4-7, 12-15, so that packing the two to 16 bits restores the order.
struct EdgeLanes {
  __m256i low, high;

  VOXDAG_INLINE void set(int64_t a, int64_t b) {
    const __m256i one_p = _mm256_setr_epi32(0, -1, 0, -1, 0, -1, 0, -1);
    const __m256i one_q = _mm256_setr_epi32(0, 0, -1, -1, 0, 0, -1, -1);
    const __m256i upper = _mm256_setr_epi32(0, 0, 0, 0, -1, -1, -1, -1);
    const __m256i va = _mm256_set1_epi32(static_cast<int32_t>(a));
    const __m256i vb = _mm256_set1_epi32(static_cast<int32_t>(b));
    const __m256i va2 = _mm256_add_epi32(va, va), vb2 = _mm256_add_epi32(vb, vb);
    const __m256i highest =
        _mm256_set1_epi32(static_cast<int32_t>(3 * (above_zero(a) + above_zero(b))));
    __m256i base = _mm256_add_epi32(_mm256_and_si256(va, one_p), _mm256_and_si256(vb, one_q));
    base = _mm256_sub_epi32(base, highest);
    low = _mm256_add_epi32(base, _mm256_and_si256(vb2, upper));
    high = _mm256_add_epi32(low, va2);
  }
};

// The edges in the projection along the columns.
struct EdgeSet {
  int64_t p4[3], q4[3], c[3];  // largest value over a brick: p4 brick_p + q4 brick_q + c
  int64_t drop[3];             // from there to the smallest over the brick's whole footprint
  EdgeLanes lanes[3];

  // `swap`: an edge's a belongs to axis q and b to p.
  VOXDAG_INLINE void set(const Edge (&edges)[3], bool swap) {
    for (int i = 0; i < 3; ++i) {
      const int64_t a = swap ? edges[i].b : edges[i].a, b = swap ? edges[i].a : edges[i].b;
      p4[i] = 4 * a;
      q4[i] = 4 * b;
      c[i] = edges[i].c + 3 * (above_zero(a) + above_zero(b));
      drop[i] = 4 * (magnitude(a) + magnitude(b));
      lanes[i].set(a, b);
    }
  }
  VOXDAG_INLINE int64_t highest(int i, int p, int q) const { return c[i] + p4[i] * p + q4[i] * q; }

  // The columns of bricks in the rows first_q..last_q, from first_p to last_p, that no edge
  // crosses, and those that perhaps one does.
  VOXDAG_INLINE void find_columns(int first_p, int last_p, int first_q, int last_q,
                                  ColumnSet& plain, ColumnSet& edge) const;

  // Voxel columns on the outer side of one of the first Count edges named, whose largest values
  // over the brick are `highest`, not negative: all ones in their 16-bit lanes.
  template <int Count>
  VOXDAG_INLINE __m256i outer(const uint8_t (&edges)[3], const int64_t (&highest)[3]) const {
    __m256i low = _mm256_setzero_si256(), high = low;
    for (int k = 0; k < Count; ++k) {
      const int64_t value = highest[edges[k]];
      const __m256i base =
          _mm256_set1_epi32(static_cast<int32_t>(value < kEdgeClamp ? value : kEdgeClamp));
      low = _mm256_or_si256(low, _mm256_add_epi32(base, lanes[edges[k]].low));
      high = _mm256_or_si256(high, _mm256_add_epi32(base, lanes[edges[k]].high));
    }
    return _mm256_srai_epi16(_mm256_packs_epi32(low, high), 15);
  }
};

// Which columns of bricks of a row (one q) the edges touch, and which of these no edge crosses.
// Bounds are computed in doubles and widened, or narrowed, by more than the rounding error. They
// are from 0 to 15, or empty with -16 <= to < from <= 16.
struct Row {
  int from, to;              // columns to look at: the others are outside
  int inner_from, inner_to;  // of these, those inside of all edges for certain
};

class RowBounds {
 public:
  // For rows from p = first to last.
  VOXDAG_INLINE RowBounds(const EdgeSet& set, int first, int last) {
    limits_ = _mm256_setr_pd(first, -last, first, -last);
    for (int i = 0; i < 3; ++i) {
      // The largest value over a column of bricks, m = c + p4 p + q4 q, is 0 at p = at + step q.
      // An edge parallel to the row excludes all of it or nothing; a nearly parallel one does the
      // same.
      const double slope = set.p4[i] == 0 ? 0x1p-60 : static_cast<double>(set.p4[i]);
      const double inverse = -1.0 / slope;
      const double at = static_cast<double>(set.c[i]) * inverse;
      const double step = static_cast<double>(set.q4[i]) * inverse;
      const double width = static_cast<double>(set.drop[i]) * (inverse < 0 ? -inverse : inverse);
      const double slack = ((at < 0 ? -at : at) + 16 * (step < 0 ? -step : step) + width) * 0x1p-46;
      // Lower bounds of: from, -to, inner_from, -inner_to.
      if (slope > 0) {
        start_[i] = _mm256_setr_pd(at - slack, kNone, at + width + slack, kNone);
        step_[i] = _mm256_setr_pd(step, 0, step, 0);
      } else {
        start_[i] = _mm256_setr_pd(kNone, -at - slack, kNone, -at + width + slack);
        step_[i] = _mm256_setr_pd(0, -step, 0, -step);
      }
    }
  }

  VOXDAG_INLINE Row row(int q) const {
    const __m256d vq = _mm256_set1_pd(q);
    __m256d bound = limits_;
    for (int i = 0; i < 3; ++i)
      bound = _mm256_max_pd(bound, _mm256_add_pd(start_[i], _mm256_mul_pd(vq, step_[i])));
    bound = _mm256_ceil_pd(_mm256_min_pd(bound, _mm256_set1_pd(16.0)));
    const __m128i whole = _mm256_cvttpd_epi32(bound);
    return {_mm_extract_epi32(whole, 0), -_mm_extract_epi32(whole, 1), _mm_extract_epi32(whole, 2),
            -_mm_extract_epi32(whole, 3)};
  }

 private:
  static constexpr double kNone = -1e30;

  __m256d start_[3], step_[3], limits_;
};

VOXDAG_INLINE void EdgeSet::find_columns(int first_p, int last_p, int first_q, int last_q,
                                         ColumnSet& plain, ColumnSet& edge) const {
  const RowBounds bounds(*this, first_p, last_p);
  for (int q = first_q; q <= last_q; ++q) {
    const Row row = bounds.row(q);
    const uint16_t all = ColumnSet::bits(row.from, row.to);
    plain.rows[q] = all & ColumnSet::bits(row.inner_from, row.inner_to);
    edge.rows[q] = all & ~plain.rows[q];
  }
}

}  // namespace
}  // namespace voxdag::cpu
