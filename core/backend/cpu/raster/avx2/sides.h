// Bounds of the heights in each voxel column (p, q), from the triangle's box and from the edge
// tests in the two projections that show the height. One projection bounds the heights for every p,
// the other projection bounds them for every q. The bounds of both projections are computed once
// per row of the tile.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/edge_bounds.h"
#include "core/backend/cpu/raster/avx2/tile_columns.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

// Bounds `below` and `over` of the heights in the 16 voxel columns of a column of bricks, one byte
// each. Heights z are counted from the floor of the brick in which the column of bricks begins
// (heights.h). The touched voxels have below < z <= 15 - over. Each half of the vector is for eight
// voxel columns: first their `below`, then their `over`. A bound of 0 excludes no voxel that the
// plane touches, so bounds are combined by their maximum. `below` of 15 or more, or `over` of 16 or
// more, excludes everything.
using HeightBounds = __m256i;
constexpr int kMaxHeight = 15;

// Byte indexes for a shuffle that copies the bounds of a row of bricks (first four lower bounds,
// then four upper bounds) to the 16 voxel columns. byte[1] is for bounds that depend on p, byte[0]
// for bounds that depend on q (tile_columns.h).
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

// Sides stores bounds of heights in the tile, with kBelowFloor added to `below` and kOverFloor
// added to `over`, so that no bound is negative. To get the HeightBounds of a column of bricks that
// begins in `brick`, Sides subtracts BrickFloors::byte[brick + kLowestBrick]. `brick` can be
// negative, because a column can begin up to ten voxels below the tile (heights.h).
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
    return from_floor(_mm256_max_epu8(by_q_[q], by_p_[p]), brick);
  }
  // The next two functions return the bounds from one projection only.
  VOXDAG_INLINE HeightBounds bounds_of_q(int q, int brick) const {
    return from_floor(by_q_[q], brick);
  }
  VOXDAG_INLINE HeightBounds bounds_of_p(int p, int brick) const {
    return from_floor(by_p_[p], brick);
  }

 private:
  static VOXDAG_INLINE HeightBounds from_floor(__m256i bounds, int brick) {
    const __m256i floors = _mm256_broadcastsi128_si256(
        _mm_load_si128(reinterpret_cast<const __m128i*>(kBrickFloors.byte[brick + kLowestBrick])));
    return _mm256_subs_epu8(bounds, floors);
  }

  template <int Axis>
  static VOXDAG_INLINE void set_rows(const TileTriangle<int32_t>& t, const Edge (&edges)[3],
                                     bool bound_first, int of_p, __m256i box, __m256i (&rows)[16]) {
    const EdgeBounds bounds(edges, bound_first, kBelowFloor, kOverFloor + kMaxHeight + 1);
    const __m256i order =
        _mm256_load_si256(reinterpret_cast<const __m256i*>(kSideOrder.byte[of_p]));
    // A bound of 120 excludes everything and fits in a signed byte.
    const __m256d most = _mm256_set1_pd(120.0);
    for (int i = t.first_voxel[Axis] / 4; i <= t.last_voxel[Axis] / 4; ++i) {
      const __m256d k = load_doubles(kDoubles.of + 4 * i);
      // The conversion turns values below the range of integers into the smallest integer. Packing
      // turns negative integers into 0.
      const __m128i words =
          _mm_packs_epi32(_mm256_cvttpd_epi32(_mm256_min_pd(bounds.below(k), most)),
                          _mm256_cvttpd_epi32(_mm256_min_pd(bounds.over(k), most)));
      const __m256i bytes = _mm256_broadcastsi128_si256(_mm_packus_epi16(words, words));
      rows[i] = _mm256_max_epu8(_mm256_shuffle_epi8(bytes, order), box);
    }
  }

  __m256i by_q_[16], by_p_[16];  // bounds for each row of bricks
};

}  // namespace
}  // namespace voxdag::cpu
