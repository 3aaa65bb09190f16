// Bounds of the heights in each voxel column (p, q), from the triangle's box and from the edge
// tests in the two projections that show the height. One projection bounds the heights for every p,
// the other for every q. Both are computed once per row of the tile.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/edge_bounds.h"
#include "core/backend/cpu/raster/avx2/tile_columns.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

// Bounds of the heights in the 16 voxel columns of a column of bricks, one byte each, counted from
// the floor of the brick where the column of bricks begins. The touched voxels are those with
// below < z <= 15 - over. Each half has eight columns, first their `below`, then their `over`. A
// bound of 0 excludes nothing, so bounds are combined by their maximum. `below` of 15 or more, or
// `over` of 16 or more, excludes everything.
using HeightBounds = __m256i;
constexpr int kMaxHeight = 15;

// Byte indexes that spread the four bounds from below and the four from above of a row of bricks to
// the 16 columns. [1] spreads bounds that depend on p, [0] bounds that depend on q.
struct SideOrder {
  alignas(32) uint8_t byte[2][32] = {};
  constexpr SideOrder() {
    for (int of_p = 0; of_p < 2; ++of_p)
      for (int i = 0; i < 32; ++i) {
        const int column = i / 16 * 8 + i % 8;
        byte[of_p][i] =
            static_cast<uint8_t>((of_p ? column_p(column) : column_q(column)) + i / 8 % 2 * 4);
      }
  }
};
constexpr SideOrder kSideOrder;

// Bounds of heights in the tile are stored with kBelowFloor added to `below` and kOverFloor added
// to `over`, so that none is negative. Element [brick + kLowestBrick] is subtracted from them for a
// column of bricks that begins in `brick`, at most ten voxels below the tile (heights.h).
constexpr int kBelowFloor = 16, kOverFloor = 64, kLowestBrick = 4;
struct BrickFloors {
  alignas(16) uint8_t byte[16 + kLowestBrick][16] = {};
  constexpr BrickFloors() {
    for (int i = 0; i < 16 + kLowestBrick; ++i)
      for (int k = 0; k < 16; ++k) {
        const int floor = 4 * (i - kLowestBrick);
        byte[i][k] = static_cast<uint8_t>(k < 8 ? kBelowFloor + floor : kOverFloor - floor);
      }
  }
};
constexpr BrickFloors kBrickFloors;

template <int D>
class Sides {
 public:
  VOXDAG_INLINE void set(const TileTriangle<int32_t>& t) {
    const __m256i box = _mm256_unpacklo_epi64(
        _mm256_set1_epi8(static_cast<int8_t>(kBelowFloor + t.first_voxel[D] - 1)),
        _mm256_set1_epi8(static_cast<int8_t>(kOverFloor + kMaxHeight - t.last_voxel[D])));
    set_rows<kQ<D>>(t, t.edges[kP<D>], (kP<D> + 1) % 3 == D, 0, box, by_q_);
    set_rows<kP<D>>(t, t.edges[kQ<D>], (kQ<D> + 1) % 3 == D, 1, box, by_p_);
  }

  VOXDAG_INLINE HeightBounds bounds(int p, int q, int brick) const {
    const __m256i floors = _mm256_broadcastsi128_si256(
        _mm_load_si128(reinterpret_cast<const __m128i*>(kBrickFloors.byte[brick + kLowestBrick])));
    return _mm256_subs_epu8(_mm256_max_epu8(by_q_[q], by_p_[p]), floors);
  }

 private:
  template <int Axis>
  static VOXDAG_INLINE void set_rows(const TileTriangle<int32_t>& t, const Edge (&edges)[3],
                                     bool bound_first, int of_p, __m256i box, __m256i (&rows)[16]) {
    const EdgeBounds bounds(edges, bound_first, kBelowFloor, kOverFloor + kMaxHeight + 1);
    const __m256i order =
        _mm256_load_si256(reinterpret_cast<const __m256i*>(kSideOrder.byte[of_p]));
    // This excludes everything, and fits in a signed byte.
    const __m256d most = _mm256_set1_pd(120.0);
    for (int i = t.first_voxel[Axis] / 4; i <= t.last_voxel[Axis] / 4; ++i) {
      const __m256d k = load_doubles(kDoubles.of + 4 * i);
      // Values too small for an integer become the smallest one, and then 0.
      const __m128i words =
          _mm_packs_epi32(_mm256_cvttpd_epi32(_mm256_min_pd(bounds.below(k), most)),
                          _mm256_cvttpd_epi32(_mm256_min_pd(bounds.over(k), most)));
      const __m256i bytes = _mm256_broadcastsi128_si256(_mm_packus_epi16(words, words));
      rows[i] = _mm256_max_epu8(_mm256_shuffle_epi8(bytes, order), box);
    }
  }

  __m256i by_q_[16], by_p_[16];  // by row of bricks
};

}  // namespace
}  // namespace voxdag::cpu
