// The voxels of a column of bricks in the AVX-512 rasterizer (draw.cc): bounds of heights by all
// edges at once, whether they cross the column or not, and the bits of the voxels between the
// bounds. The computation is that of avx2/sides.h and avx2/heights.h, where rounding is justified.
//
// Only included by sources compiled for AVX-512 (F, BW, DQ, VL, VBMI); everything has internal
// linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/sides.h"
#include "core/backend/cpu/raster/avx512/edges.h"

namespace voxdag::cpu {
namespace {

// The permutation of the bounds by q (bytes 0..3) and by p (4..7), `below` and 8 bytes later
// `over`, to HeightBounds: [of p].
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

// The edges in the projections along P and along Q, as bounds of heights: eight lanes, four by q
// and four by p.
class Sides512 {
 public:
  // For columns along D.
  template <int D>
  VOXDAG_INLINE void set(const TileTriangle<int32_t>& t) {
    constexpr bool kSwapQ = (kP<D> + 1) % 3 == D, kSwapP = (kQ<D> + 1) % 3 == D;
    const __m512d zero = _mm512_setzero_pd();
    const __m512d steps = _mm512_setr_pd(0, 1, 2, 3, 0, 1, 2, 3);
    const EdgeLanes512 of_q(t.edges[kP<D>]), of_p(t.edges[kQ<D>]);
    const __m512d across = pair(kSwapQ ? of_q.b : of_q.a, kSwapP ? of_p.b : of_p.a);
    const __m512d up = pair(kSwapQ ? of_q.a : of_q.b, kSwapP ? of_p.a : of_p.b);
    const __m512d c = pair(of_q.c, of_p.c);
    const __mmask8 falling = _mm512_cmp_pd_mask(up, zero, _CMP_LT_OQ);
    const __m512d inverse =
        _mm512_mask_mov_pd(_mm512_div_pd(_mm512_set1_pd(1.0), _mm512_abs_pd(up)),
                           _mm512_cmp_pd_mask(up, zero, _CMP_EQ_OQ), _mm512_set1_pd(0x1p60));
    const __m512d more = _mm512_mask_mov_pd(_mm512_set1_pd(-0x1p-30), falling,
                                            _mm512_set1_pd(kMaxHeight + 1 - 0x1p-30));
    for (int i = 0; i < 3; ++i) {
      const __m512i lanes = _mm512_set_epi64(4 + i, 4 + i, 4 + i, 4 + i, i, i, i, i);
      const auto spread = [lanes](__m512d x) __attribute__((always_inline)) {
        return _mm512_permutexvar_pd(lanes, x);
      };
      start_[i] = _mm512_fnmsub_pd(spread(across), steps, spread(c));
      across4_[i] = _mm512_mul_pd(spread(across), _mm512_set1_pd(-4.0));
      up4_[i] = _mm512_mul_pd(spread(up), _mm512_set1_pd(-4.0));
      inverse_[i] = spread(inverse);
      more_[i] = spread(more);
      falls_[i] = static_cast<__mmask8>((falling >> i & 1 ? 0x0f : 0) |
                                        (falling >> (4 + i) & 1 ? 0xf0 : 0));
    }
    low_ = t.first_voxel[D] - 1;
    high_ = kMaxHeight - t.last_voxel[D];
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
    // Values that are too large for an integer become the largest integer.
    const __m512i both = _mm512_inserti64x4(_mm512_castsi256_si512(_mm512_cvttpd_epu32(below)),
                                            _mm512_cvttpd_epu32(over), 1);
    const __m256i bytes = _mm256_castsi128_si256(_mm512_cvtusepi32_epi8(both));
    return _mm256_max_epu8(_mm256_permutexvar_epi8(order(0), bytes),
                           _mm256_permutexvar_epi8(order(1), bytes));
  }

 private:
  static VOXDAG_INLINE __m512d pair(__m256d of_q, __m256d of_p) {
    return _mm512_insertf64x4(_mm512_castpd256_pd512(of_q), of_p, 1);
  }
  static VOXDAG_INLINE __m256i order(int of_p) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(kSideBytes.from[of_p]));
  }

  // By edge: -across times 0..3, less c; the increments per brick across and upwards; 1 / |up|, and
  // the term added after the division; whether the edge bounds heights from above.
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
      const int p = brick_coordinate(voxel, kP<D>), q = brick_coordinate(voxel, kQ<D>);
      const int column = (p & 1) | (q & 1) << 1 | (p & 2) << 1 | (q & 2) << 2;
      below[voxel] = static_cast<uint8_t>(column / 8 * 16 + column % 8);
      over[voxel] = static_cast<uint8_t>(below[voxel] + 8);
      for (int brick = 0; brick < 4; ++brick) {
        const int z = 4 * brick + brick_coordinate(voxel, D);
        height[brick][voxel] = static_cast<uint8_t>(z);
        depth[brick][voxel] = static_cast<uint8_t>(kMaxHeight - z);
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
