// The plane test of the AVX2 rasteriser (draw_avx2.cc): between which heights the plane passes each
// of the 16 voxel columns of a column of bricks, and the bits of the voxels between them.
//
// Along the axis D of the normal's largest component a column is touched at the heights z with
//     0 <= n_D z + n.(p, q) + lowest <= width       (tile_triangle.h), that is
//     y < z + 1,  z <= y + width / n_D              with y = -(n.(p, q) + lowest) / n_D
// at most four voxels, since width <= 3 n_D. Lanes hold y in 16 bits, 12 of them below the voxel,
// relative to the brick where the column begins: y spans 0..4 for the lowest of the 16, up to 6
// more for the others, up to 3 more above. Rounded downwards (y) and upwards, never by more than 3
// and 5 units; a lane whose height is then too near to a whole number, in doubt between two voxels,
// is settled by division (about 3 columns of bricks in 100 have one).
//
// Only included by sources compiled for AVX2; all of it has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/edges_avx2.h"
#include "core/backend/cpu/tile_triangle.h"

namespace voxdag::cpu {
namespace {

constexpr int kHeightBits = 12;  // below the voxel, in 16-bit lanes
constexpr int kColumnBits = 40;  // below the voxel, per column of bricks in 64 bits

// The axes of a column's footprint for columns along D, chosen so that the bits of a voxel column's
// number, p + 2 q (low bits of p, q) + 4 p + 8 q (high bits), are in the order of the brick's bits.
template <int D>
constexpr int kP = D == 0 ? 2 : 0;
template <int D>
constexpr int kQ = D == 2   ? 1
                   : D == 1 ? 2
                            : 1;

constexpr int column_p(int column) { return (column & 1) | (column >> 1 & 2); }
constexpr int column_q(int column) { return (column >> 1 & 1) | (column >> 2 & 2); }

// A brick's 64 voxels as bytes of two vectors: bit 5 of a voxel's number chooses the vector, bit 4
// its half. Axis a owns bits a and a + 3 of the number.
template <int D>
struct ByteOrder {
  alignas(32) int8_t column[2][32] = {};     // lower three bits of the voxel's column
  alignas(32) int8_t height[4][2][32] = {};  // of the voxel above the first of four bricks
  constexpr ByteOrder() {
    for (int voxel = 0; voxel < 64; ++voxel) {
      const auto coordinate = [voxel](int axis) {
        return (voxel >> axis & 1) | (voxel >> (axis + 3) & 1) << 1;
      };
      const int p = coordinate(kP<D>), q = coordinate(kQ<D>);
      column[voxel / 32][voxel % 32] = static_cast<int8_t>((p & 1) | (q & 1) << 1 | (p & 2) << 1);
      for (int brick = 0; brick < 4; ++brick)
        height[brick][voxel / 32][voxel % 32] = static_cast<int8_t>(4 * brick + coordinate(D));
    }
  }
};
template <int D>
inline constexpr ByteOrder<D> kByteOrder;

VOXDAG_INLINE __m256i load(const void* at) {
  return _mm256_load_si256(static_cast<const __m256i*>(at));
}

template <int D>
class Heights {
 public:
  // Voxels of a column with below < height <= top are touched: a byte per voxel of a brick.
  struct Bounds {
    __m256i below[2], top[2];

    // The voxels of the brick that is `up` bricks above the one where the column begins, up < 4.
    VOXDAG_INLINE uint64_t mask(int up) const {
      uint32_t half[2];
      for (int i = 0; i < 2; ++i) {
        const __m256i z = load(kByteOrder<D>.height[up][i]);
        half[i] = static_cast<uint32_t>(_mm256_movemask_epi8(
            _mm256_andnot_si256(_mm256_cmpgt_epi8(z, top[i]), _mm256_cmpgt_epi8(z, below[i]))));
      }
      return half[0] | static_cast<uint64_t>(half[1]) << 32;
    }
  };

  VOXDAG_INLINE explicit Heights(const TileTriangle<int32_t>& triangle) : t(triangle) {
    const int64_t np = t.normal[P], nq = t.normal[Q];
    const double inverse = 1.0 / static_cast<double>(t.normal[D]);
    const double column_unit = inverse * static_cast<double>(int64_t{1} << kColumnBits);
    step_p = static_cast<int64_t>(-4.0 * static_cast<double>(np) * column_unit);
    step_q = static_cast<int64_t>(-4.0 * static_cast<double>(nq) * column_unit);
    const int64_t lowest = t.lowest + 3 * (above_zero(np) + above_zero(nq));
    origin = static_cast<int64_t>(-static_cast<double>(lowest) * column_unit) -
             (int64_t{1} << (kColumnBits - kHeightBits));
    const double unit = inverse * (1 << kHeightBits);
    const float sp = static_cast<float>(static_cast<double>(magnitude(np)) * unit);
    const float sq = static_cast<float>(static_cast<double>(magnitude(nq)) * unit);
    const int width = static_cast<int>(static_cast<double>(t.width) * unit) + 5;
    reach = static_cast<int>(3.0f * (sp + sq)) + 2 + width;
    width_lanes_ = _mm256_set1_epi16(static_cast<int16_t>(width));
    set_lanes(np > 0, sp, nq > 0, sq);
  }

  // The height of a column of bricks: that of its lowest voxel column, one unit of 16-bit lanes
  // lower, kColumnBits below the voxel. 12 + 40 bits and 16 columns: off by less than 2^-30.
  int64_t origin, step_p, step_q;
  // From there to the highest top of the column, in units of 16-bit lanes, rounded up.
  int reach;

  // For the column of bricks (p, q) that begins in `brick`, `within` units above its floor; lanes
  // of `outer` that are all ones have no voxels.
  VOXDAG_INLINE Bounds bounds(int p, int q, int brick, int within, __m256i outer) const {
    __m256i below = _mm256_add_epi16(_mm256_set1_epi16(static_cast<int16_t>(within)), lanes_);
    __m256i top = _mm256_add_epi16(below, width_lanes_);
    const __m256i raised = _mm256_add_epi16(below, _mm256_set1_epi16(3));
    const __m256i lowered = _mm256_sub_epi16(top, _mm256_set1_epi16(5));
    const __m256i differ =
        _mm256_or_si256(_mm256_xor_si256(raised, below), _mm256_xor_si256(lowered, top));
    const __m256i whole = _mm256_set1_epi16(static_cast<int16_t>(0xffff << kHeightBits));
    if (!_mm256_testz_si256(differ, whole)) [[unlikely]]
      settle(p, q, brick, _mm256_and_si256(differ, whole), below, top);
    below = _mm256_or_si256(below, outer);
    return spread(_mm256_packus_epi16(_mm256_srli_epi16(below, kHeightBits),
                                      _mm256_srli_epi16(top, kHeightBits)));
  }

 private:
  static constexpr int P = kP<D>, Q = kQ<D>;

  // How far each column is above the lowest one: sp, sq are the slopes' magnitudes.
  VOXDAG_INLINE void set_lanes(bool p_falls, float sp, bool q_falls, float sq) {
    const __m256 p_low =
        p_falls ? _mm256_setr_ps(3, 2, 3, 2, 3, 2, 3, 2) : _mm256_setr_ps(0, 1, 0, 1, 0, 1, 0, 1);
    const __m256 p_high = _mm256_add_ps(p_low, _mm256_set1_ps(p_falls ? -2.0f : 2.0f));
    const __m256 q_both =
        q_falls ? _mm256_setr_ps(3, 3, 2, 2, 1, 1, 0, 0) : _mm256_setr_ps(0, 0, 1, 1, 2, 2, 3, 3);
    const __m256 from_q = _mm256_mul_ps(q_both, _mm256_set1_ps(sq));
    const __m256 vsp = _mm256_set1_ps(sp);
    lanes_ =
        _mm256_packs_epi32(_mm256_cvttps_epi32(_mm256_add_ps(_mm256_mul_ps(p_low, vsp), from_q)),
                           _mm256_cvttps_epi32(_mm256_add_ps(_mm256_mul_ps(p_high, vsp), from_q)));
  }

  // Makes the columns exact whose bits in `doubtful` are not 0.
  [[gnu::noinline]] void settle(int p, int q, int brick, __m256i doubtful, __m256i& below,
                                __m256i& top) const {
    alignas(32) uint16_t doubt[16], low[16], high[16];
    _mm256_store_si256(reinterpret_cast<__m256i*>(doubt), doubtful);
    _mm256_store_si256(reinterpret_cast<__m256i*>(low), below);
    _mm256_store_si256(reinterpret_cast<__m256i*>(high), top);
    const int64_t n = t.normal[D];
    for (int i = 0; i < 16; ++i) {
      if (doubt[i] == 0) continue;
      const int64_t at_zero =
          t.lowest + t.normal[P] * (4 * p + column_p(i)) + t.normal[Q] * (4 * q + column_q(i));
      low[i] = static_cast<uint16_t>((floor_divide(-at_zero - 1, n) - 4 * brick) << kHeightBits);
      high[i] =
          static_cast<uint16_t>((floor_divide(t.width - at_zero, n) - 4 * brick) << kHeightBits);
    }
    below = load(low);
    top = load(high);
  }

  static int64_t floor_divide(int64_t a, int64_t b) {
    const int64_t quotient = a / b;
    return quotient - (quotient * b > a ? 1 : 0);
  }

  // From one byte per column (`below` of eight columns, then `top` of the same, in either half) to
  // one byte per voxel. The half of a column is its high bit of q: for D = 1 that is the vector of
  // its voxels, otherwise their half.
  static VOXDAG_INLINE Bounds spread(__m256i bytes) {
    const __m256i order0 = load(kByteOrder<D>.column[0]), order1 = load(kByteOrder<D>.column[1]);
    const __m256i eight = _mm256_set1_epi8(8);
    const __m256i half0 = D == 1 ? _mm256_permute4x64_epi64(bytes, 0x44) : bytes;
    const __m256i half1 = D == 1 ? _mm256_permute4x64_epi64(bytes, 0xee) : bytes;
    return {{_mm256_shuffle_epi8(half0, order0), _mm256_shuffle_epi8(half1, order1)},
            {_mm256_shuffle_epi8(half0, _mm256_add_epi8(order0, eight)),
             _mm256_shuffle_epi8(half1, _mm256_add_epi8(order1, eight))}};
  }

  const TileTriangle<int32_t>& t;
  __m256i lanes_, width_lanes_;
};

}  // namespace
}  // namespace voxdag::cpu
