// Edge tests of the AVX-512 rasterizer (draw.cc), for columns of bricks and for 16 voxel columns at
// once: those of avx2/edges.h for all edges, or all rows, at once. Values of edges over columns of
// bricks are whole numbers below 2^53, so exact in doubles, fused or not.
//
// Only included by sources compiled for AVX-512 (F, BW, DQ, VL, VBMI); everything has internal
// linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/column_set.h"
#include "core/backend/cpu/raster/avx2/edges.h"

namespace voxdag::cpu {
namespace {

// The bricks 0..15 of a row as doubles.
struct Doubles {
  alignas(64) double of[16] = {};
  constexpr Doubles() {
    for (int i = 0; i < 16; ++i) of[i] = i;
  }
};
constexpr Doubles kDoubles;

// Three edges, one per lane, the fourth lane unused: a, b, c.
struct EdgeLanes512 {
  __m256d a, b, c;

  VOXDAG_INLINE explicit EdgeLanes512(const Edge (&edges)[3]) {
    static_assert(sizeof(Edge) == 3 * sizeof(int64_t));
    const __m512i values = _mm512_loadu_si512(&edges[0]);  // all but the last c
    const auto pick = [values](int first) __attribute__((always_inline)) {
      return _mm512_castsi512_si256(_mm512_permutexvar_epi64(
          _mm512_set_epi64(0, 0, 0, 0, 0, (first + 6) & 7, first + 3, first), values));
    };
    a = _mm256_cvtepi64_pd(pick(0));
    b = _mm256_cvtepi64_pd(pick(1));
    c = _mm256_cvtepi64_pd(_mm256_mask_set1_epi64(pick(2), 0b0100, edges[2].c));
  }
};

VOXDAG_INLINE __m512d broadcast(__m256d lanes, int lane) {
  return _mm512_permutexvar_pd(_mm512_set1_epi64(lane), _mm512_castpd256_pd512(lanes));
}
VOXDAG_INLINE __m256d magnitude(__m256d x) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), x); }

// The edges in the projection along the columns.
class EdgeSet512 {
 public:
  // `swap`: an edge's a belongs to axis q and b to p.
  VOXDAG_INLINE void set(const Edge (&edges)[3], bool swap) {
    const EdgeLanes512 lanes(edges);
    const __m256d a = swap ? lanes.b : lanes.a, b = swap ? lanes.a : lanes.b;
    const __m256d zero = _mm256_setzero_pd(), four = _mm256_set1_pd(4.0);
    const __m256d rise = _mm256_mul_pd(
        _mm256_set1_pd(3.0), _mm256_add_pd(_mm256_max_pd(a, zero), _mm256_max_pd(b, zero)));
    p4_ = _mm256_mul_pd(a, four);
    q4_ = _mm256_mul_pd(b, four);
    c_ = _mm256_add_pd(lanes.c, rise);
    drop_ = _mm256_mul_pd(_mm256_add_pd(magnitude(a), magnitude(b)), four);
    // Bits of columns whose p, q have the low bit, and the high one.
    constexpr __mmask16 kLowP = 0xaaaa, kLowQ = 0xcccc, kHighP = 0xf0f0, kHighQ = 0xff00;
    for (int i = 0; i < 3; ++i) {
      const auto spread = [i](__m256d x) __attribute__((always_inline)) {
        return _mm512_permutexvar_epi32(_mm512_set1_epi32(i),
                                        _mm512_castsi128_si512(_mm256_cvtpd_epi32(x)));
      };
      const __m512i va = spread(a), vb = spread(b);
      __m512i less = spread(rise);
      less = _mm512_mask_sub_epi32(less, kLowP, less, va);
      less = _mm512_mask_sub_epi32(less, kHighP, less, _mm512_add_epi32(va, va));
      less = _mm512_mask_sub_epi32(less, kLowQ, less, vb);
      less_[i] = _mm512_mask_sub_epi32(less, kHighQ, less, _mm512_add_epi32(vb, vb));
    }
  }

  // EdgeSet::find_columns() for all rows at once, one per lane.
  VOXDAG_INLINE void find_columns(int first_p, int last_p, int first_q, int last_q,
                                  ColumnSet& plain, ColumnSet& edge) const {
    const Divided d(*this);
    const __m512d rows[2] = {_mm512_load_pd(kDoubles.of), _mm512_load_pd(kDoubles.of + 8)};
    const __m512d first = _mm512_set1_pd(first_p), less_last = _mm512_set1_pd(-last_p);
    // Lower bounds of: from, -to, inner_from, -inner_to.
    __m512d bounds[4][2] = {
        {first, first}, {less_last, less_last}, {first, first}, {less_last, less_last}};
    for (int i = 0; i < 3; ++i) {
      const __mmask8 rises = static_cast<__mmask8>(-(d.rising >> i & 1));
      const __mmask8 falls = static_cast<__mmask8>(~rises);
      const __m512d step = broadcast(d.step, i), outer = broadcast(d.outer, i);
      const __m512d inner = broadcast(d.inner, i);
      for (int h = 0; h < 2; ++h) {
        const __m512d o = _mm512_fmadd_pd(step, rows[h], outer);
        const __m512d n = _mm512_fmadd_pd(step, rows[h], inner);
        bounds[0][h] = _mm512_mask_max_pd(bounds[0][h], rises, bounds[0][h], o);
        bounds[1][h] = _mm512_mask_max_pd(bounds[1][h], falls, bounds[1][h], o);
        bounds[2][h] = _mm512_mask_max_pd(bounds[2][h], rises, bounds[2][h], n);
        bounds[3][h] = _mm512_mask_max_pd(bounds[3][h], falls, bounds[3][h], n);
      }
    }
    const __m512i all = bits(bounds[0], bounds[1]);
    const __m512i uncrossed = _mm512_and_si512(all, bits(bounds[2], bounds[3]));
    const __mmask16 there = ColumnSet::bits(first_q, last_q);
    store(plain, _mm512_maskz_cvtepi32_epi16(there, uncrossed));
    store(edge, _mm512_maskz_cvtepi32_epi16(there, _mm512_andnot_si512(uncrossed, all)));
  }

  // The voxel columns of a column of bricks that are on the outer side of an edge.
  VOXDAG_INLINE uint32_t outer(int p, int q) const {
    const __m256d most = _mm256_fmadd_pd(p4_, _mm256_set1_pd(kDoubles.of[p]),
                                         _mm256_fmadd_pd(q4_, _mm256_set1_pd(kDoubles.of[q]), c_));
    // Values that are too large become 2^30, those that are too small the smallest integer.
    const __m512i values = _mm512_castsi128_si512(
        _mm256_cvttpd_epi32(_mm256_min_pd(most, _mm256_set1_pd(double{kEdgeClamp}))));
    const auto edge = [&](int i) __attribute__((always_inline)) {
      return static_cast<uint32_t>(_mm512_cmplt_epi32_mask(
          _mm512_permutexvar_epi32(_mm512_set1_epi32(i), values), less_[i]));
    };
    return edge(0) | edge(1) | edge(2);
  }

 private:
  // RowBounds (avx2/edges.h), one edge per lane: where a row meets it, at + step q, as lower bounds
  // of p for edges that rise along p, of -p for those that fall.
  struct Divided {
    __m256d step, outer, inner;
    uint32_t rising;

    VOXDAG_INLINE explicit Divided(const EdgeSet512& set) {
      const __m256d zero = _mm256_setzero_pd();
      const __m256d slope = _mm256_mask_mov_pd(
          set.p4_, _mm256_cmp_pd_mask(set.p4_, zero, _CMP_EQ_OQ), _mm256_set1_pd(0x1p-60));
      const __mmask8 falls = _mm256_cmp_pd_mask(slope, zero, _CMP_LT_OQ);
      rising = ~uint32_t{falls};
      const __m256d inverse = _mm256_div_pd(_mm256_set1_pd(-1.0), slope);
      __m256d at = _mm256_mul_pd(set.c_, inverse);
      step = _mm256_mul_pd(set.q4_, inverse);
      const __m256d width = _mm256_mul_pd(set.drop_, magnitude(inverse));
      const __m256d size = _mm256_add_pd(
          _mm256_fmadd_pd(_mm256_set1_pd(16.0), magnitude(step), magnitude(at)), width);
      const __m256d slack = _mm256_mul_pd(size, _mm256_set1_pd(0x1p-46));
      at = _mm256_mask_sub_pd(at, falls, zero, at);
      step = _mm256_mask_sub_pd(step, falls, zero, step);
      outer = _mm256_sub_pd(at, slack);
      inner = _mm256_add_pd(_mm256_add_pd(at, width), slack);
    }
  };

  // Bits from..to of each row, by lower bounds of from and -to.
  static VOXDAG_INLINE __m512i bits(const __m512d (&from)[2], const __m512d (&less_to)[2]) {
    const auto whole = [](const __m512d(&bound)[2]) __attribute__((always_inline)) {
      const auto half = [](__m512d x) __attribute__((always_inline)) {
        return _mm512_cvt_roundpd_epi32(_mm512_min_pd(x, _mm512_set1_pd(16.0)),
                                        _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC);
      };
      return _mm512_inserti64x4(_mm512_castsi256_si512(half(bound[0])), half(bound[1]), 1);
    };
    const __m512i ones = _mm512_set1_epi32(0xffff);
    const __m512i beyond = _mm512_add_epi32(whole(less_to), _mm512_set1_epi32(15));
    return _mm512_and_si512(_mm512_srlv_epi32(ones, beyond), _mm512_sllv_epi32(ones, whole(from)));
  }
  static VOXDAG_INLINE void store(ColumnSet& set, __m256i rows) {
    _mm256_store_si256(reinterpret_cast<__m256i*>(set.rows), rows);
  }

  // By edge: the largest value over a brick is p4 brick_p + q4 brick_q + c; the smallest is lower
  // by drop.
  __m256d p4_, q4_, c_, drop_;
  __m512i less_[3];  // by voxel column: the largest value over the brick less that over the column
};

}  // namespace
}  // namespace voxdag::cpu
