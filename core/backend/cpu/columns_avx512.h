// All that the AVX-512 rasteriser (draw_avx512.cc) asks about the edges in a column of bricks, and
// the bits of its voxels. What edges_avx2.h, sides_avx2.h and heights_avx2.h do for the edges that
// cross a column, one after the other, is done here for all three at once, without a branch; the
// bounds of rounding are argued there.
//
// Only included by sources compiled for AVX-512 (F, BW, DQ, VL, VBMI); all of it has internal
// linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/columns_avx2.h"
#include "core/backend/cpu/sides_avx2.h"

namespace voxdag::cpu {
namespace {

// The voxels 0..15 of a row as doubles.
struct Doubles {
  double of[16] = {};
  constexpr Doubles() {
    for (int i = 0; i < 16; ++i) of[i] = i;
  }
};
constexpr Doubles kDoubles;

// [of q][first][last]: the voxel columns whose p (or q) within the brick is not from first to last.
struct OutsideBits {
  uint16_t bits[2][4][4] = {};
  constexpr OutsideBits() {
    for (int column = 0; column < 16; ++column)
      for (int first = 0; first < 4; ++first)
        for (int last = 0; last < 4; ++last) {
          const int p = column_p(column), q = column_q(column);
          const uint16_t bit = static_cast<uint16_t>(1u << column);
          if (p < first || p > last) bits[0][first][last] |= bit;
          if (q < first || q > last) bits[1][first][last] |= bit;
        }
  }
};
constexpr OutsideBits kOutsideBits;

// The edges seen along the columns: of 16 voxel columns, in the order of their numbers, what a and
// b add to an edge's value less what they add at most.
struct EdgeSet512 : EdgeValues {
  __m512i lanes[3];

  VOXDAG_INLINE void set(const Edge (&edges)[3], bool swap) {
    EdgeValues::set(edges, swap);
    const __m512i kp = _mm512_setr_epi32(0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1, 2, 3, 2, 3);
    const __m512i kq = _mm512_setr_epi32(0, 0, 1, 1, 0, 0, 1, 1, 2, 2, 3, 3, 2, 2, 3, 3);
    for (int i = 0; i < 3; ++i) {
      const int64_t a = swap ? edges[i].b : edges[i].a, b = swap ? edges[i].a : edges[i].b;
      const __m512i most =
          _mm512_set1_epi32(static_cast<int32_t>(3 * (above_zero(a) + above_zero(b))));
      const __m512i from_p = _mm512_mullo_epi32(_mm512_set1_epi32(static_cast<int32_t>(a)), kp);
      const __m512i from_q = _mm512_mullo_epi32(_mm512_set1_epi32(static_cast<int32_t>(b)), kq);
      lanes[i] = _mm512_sub_epi32(_mm512_add_epi32(from_p, from_q), most);
    }
  }

  // The voxel columns of a column of bricks that are on the outer side of an edge.
  VOXDAG_INLINE uint32_t outer(int p, int q) const {
    const auto edge = [&](int i) __attribute__((always_inline)) {
      int64_t value = most(i, p, q);
      value = value < kEdgeClamp ? value : kEdgeClamp;
      value = value > -kEdgeClamp ? value : -kEdgeClamp;
      return _mm512_add_epi32(_mm512_set1_epi32(static_cast<int32_t>(value)), lanes[i]);
    };
    return _cvtmask16_u32(
        _mm512_movepi32_mask(_mm512_or_si512(_mm512_or_si512(edge(0), edge(1)), edge(2))));
  }
};

// Where the bytes of the bounds by q (0..3) and by p (4..7), `below` and then 8 further `over`,
// belong in HeightBounds: [of p].
struct SideBytes {
  alignas(32) uint8_t from[2][32] = {};
  constexpr SideBytes() {
    for (int of_p = 0; of_p < 2; ++of_p)
      for (int i = 0; i < 32; ++i) {
        const int column = i / 16 * 8 + i % 8;
        from[of_p][i] =
            static_cast<uint8_t>((of_p ? 4 + column_p(column) : column_q(column)) + i / 8 % 2 * 8);
      }
  }
};
constexpr SideBytes kSideBytes;

// The edges seen along P and along Q, as bounds of heights: eight lanes, by q and then by p.
class Sides512 {
 public:
  // Along the axes P and Q of the columns along D; box: heights of the triangle's.
  template <int D>
  VOXDAG_INLINE void set(const TileTriangle<int32_t>& t) {
    constexpr bool kSwapQ = (kP<D> + 1) % 3 == D, kSwapP = (kQ<D> + 1) % 3 == D;
    const Edge(&of_q)[3] = t.edges[kP<D>];
    const Edge(&of_p)[3] = t.edges[kQ<D>];
    const __m512d zero = _mm512_setzero_pd();
    const __m512d steps = _mm512_setr_pd(0, 1, 2, 3, 0, 1, 2, 3);
    for (int i = 0; i < 3; ++i) {
      const __m512d across = pair(kSwapQ ? of_q[i].b : of_q[i].a, kSwapP ? of_p[i].b : of_p[i].a);
      const __m512d up = pair(kSwapQ ? of_q[i].a : of_q[i].b, kSwapP ? of_p[i].a : of_p[i].b);
      const __mmask8 falls = _mm512_cmp_pd_mask(up, zero, _CMP_LT_OQ);
      const __mmask8 level = _mm512_cmp_pd_mask(up, zero, _CMP_EQ_OQ);
      start_[i] = _mm512_fnmadd_pd(across, steps, _mm512_sub_pd(zero, pair(of_q[i].c, of_p[i].c)));
      across4_[i] = _mm512_mul_pd(across, _mm512_set1_pd(-4.0));
      up4_[i] = _mm512_mul_pd(up, _mm512_set1_pd(-4.0));
      inverse_[i] = _mm512_mask_mov_pd(_mm512_div_pd(_mm512_set1_pd(1.0), _mm512_abs_pd(up)), level,
                                       _mm512_set1_pd(0x1p60));
      more_[i] = _mm512_mask_mov_pd(_mm512_set1_pd(-0x1p-30), falls,
                                    _mm512_set1_pd(kMostHeight + 1 - 0x1p-30));
      falls_[i] = falls;
    }
    low_ = t.first_voxel[D] - 1;
    high_ = kMostHeight - t.last_voxel[D];
  }

  // In the column of bricks (p, q), counted from the floor of `brick`.
  VOXDAG_INLINE HeightBounds bounds(int p, int q, int brick) const {
    const __m512d k =
        _mm512_mask_mov_pd(_mm512_set1_pd(kDoubles.of[q]), 0xf0, _mm512_set1_pd(kDoubles.of[p]));
    const __m512d z = _mm512_set1_pd(static_cast<double>(brick));
    const __m512d z4 = _mm512_mul_pd(z, _mm512_set1_pd(4.0)), zero = _mm512_setzero_pd();
    __m512d below = _mm512_max_pd(_mm512_sub_pd(_mm512_set1_pd(low_), z4), zero);
    __m512d over = _mm512_max_pd(_mm512_add_pd(_mm512_set1_pd(high_), z4), zero);
    for (int i = 0; i < 3; ++i) {
      const __m512d t = _mm512_fmadd_pd(across4_[i], k, _mm512_fmadd_pd(up4_[i], z, start_[i]));
      const __m512d bound = _mm512_fmadd_pd(t, inverse_[i], more_[i]);
      below = _mm512_mask_max_pd(below, static_cast<__mmask8>(~falls_[i]), below, bound);
      over = _mm512_mask_max_pd(over, falls_[i], over, bound);
    }
    // What is too large for an integer becomes the largest.
    const __m512i both = _mm512_inserti64x4(_mm512_castsi256_si512(_mm512_cvttpd_epu32(below)),
                                            _mm512_cvttpd_epu32(over), 1);
    const __m256i bytes = _mm256_castsi128_si256(_mm512_cvtusepi32_epi8(both));
    return _mm256_max_epu8(_mm256_permutexvar_epi8(order(0), bytes),
                           _mm256_permutexvar_epi8(order(1), bytes));
  }

 private:
  static VOXDAG_INLINE __m512d pair(int64_t of_q, int64_t of_p) {
    return _mm512_mask_mov_pd(_mm512_set1_pd(static_cast<double>(of_q)), 0xf0,
                              _mm512_set1_pd(static_cast<double>(of_p)));
  }
  static VOXDAG_INLINE __m256i order(int of_p) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(kSideBytes.from[of_p]));
  }

  // By edge: -across times 0..3, less c; what bricks across and upwards add; 1 / |up|, and what is
  // added then; whether the edge bounds heights from above.
  __m512d start_[3], across4_[3], up4_[3], inverse_[3], more_[3];
  __mmask8 falls_[3];
  double low_, high_;  // bounds by the triangle's box
};

// A brick's 64 voxels as the bytes of one vector.
template <int D>
struct VoxelBytes {
  alignas(64) uint8_t below[64] = {};  // where HeightBounds has the bounds of the voxel's column
  alignas(64) uint8_t over[64] = {};
  alignas(64) uint8_t height[4][64] = {};  // above the floor of the first of four bricks
  alignas(64) uint8_t depth[4][64] = {};   // below the highest voxel of the four
  constexpr VoxelBytes() {
    for (int voxel = 0; voxel < 64; ++voxel) {
      const auto coordinate = [voxel](int axis) {
        return (voxel >> axis & 1) | (voxel >> (axis + 3) & 1) << 1;
      };
      const int p = coordinate(kP<D>), q = coordinate(kQ<D>);
      const int column = (p & 1) | (q & 1) << 1 | (p & 2) << 1 | (q & 2) << 2;
      below[voxel] = static_cast<uint8_t>(column / 8 * 16 + column % 8);
      over[voxel] = static_cast<uint8_t>(below[voxel] + 8);
      for (int brick = 0; brick < 4; ++brick) {
        const int z = 4 * brick + coordinate(D);
        height[brick][voxel] = static_cast<uint8_t>(z);
        depth[brick][voxel] = static_cast<uint8_t>(kMostHeight - z);
      }
    }
  }
};
template <int D>
inline constexpr VoxelBytes<D> kVoxelBytes;

VOXDAG_INLINE __m512i load512(const void* at) { return _mm512_load_si512(at); }

// HeightBounds spread over the voxels of a column of bricks.
template <int D>
class Spread512 {
 public:
  VOXDAG_INLINE explicit Spread512(HeightBounds bounds) {
    const __m512i bytes = _mm512_castsi256_si512(bounds);
    below_ = _mm512_permutexvar_epi8(load512(kVoxelBytes<D>.below), bytes);
    over_ = _mm512_permutexvar_epi8(load512(kVoxelBytes<D>.over), bytes);
  }
  // The voxels of the brick that is `up` bricks above the one where the column begins, up < 4.
  VOXDAG_INLINE uint64_t mask(int64_t up) const {
    const __mmask64 above = _mm512_cmplt_epu8_mask(below_, load512(kVoxelBytes<D>.height[up]));
    return _cvtmask64_u64(
        _mm512_mask_cmple_epu8_mask(above, over_, load512(kVoxelBytes<D>.depth[up])));
  }

 private:
  __m512i below_, over_;
};

}  // namespace
}  // namespace voxdag::cpu
