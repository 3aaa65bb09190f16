// The edge tests of the AVX2 rasterizer (draw.cc) in the two projections that show the height: as
// bounds of the heights in each voxel column, so that they are computed once for a whole column of
// bricks.
//
// Seen along P an edge leaves the voxels (q, z) with across q + up z + c >= 0 (tile_triangle.h):
//     up > 0:  z >= ceil(t / |up|)         with t = -(across q + c)
//     up < 0:  z <= -ceil(t / |up|)
//     up = 0:  all, or none if t > 0
// t < 2^53 is exact in a double. t / |up| is a whole number or at least 2^-27 away from one, and
// its error within the tile, where it is at most 2^7, is below 2^-44: after subtracting 2^-30 its
// ceiling is exact. Seen along Q likewise, with p.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/column_set.h"
#include "core/backend/cpu/raster/avx2/edges.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

// Bounds of the heights in the 16 columns of a column of bricks, one byte each, counted from the
// floor of the brick where it begins: touched are below < z <= 15 - over. Each half has eight
// columns, first `below`, then `over`. Both are 0 where there is no bound, so bounds are combined
// by their maximum; 15 and more in `below`, 16 and more in `over` exclude everything.
using HeightBounds = __m256i;
constexpr int kMaxHeight = 15;

// From the four bounds by q, then four by p, to those of columns: [of p][of over].
struct SideOrder {
  alignas(32) uint8_t byte[2][2][32] = {};
  constexpr SideOrder() {
    for (int of_p = 0; of_p < 2; ++of_p)
      for (int over = 0; over < 2; ++over)
        for (int i = 0; i < 32; ++i) {
          const int column = i / 16 * 8 + i % 8;
          const int from = of_p ? 4 + column_p(column) : column_q(column);
          byte[of_p][over][i] = static_cast<uint8_t>(i / 8 % 2 == over ? from : 0x80);
        }
  }
};
constexpr SideOrder kSideOrder;

template <int D>
class Sides {
 public:
  VOXDAG_INLINE void set(const TileTriangle<int32_t>& t) {
    by_q_.set(t.edges[kP<D>], (kP<D> + 1) % 3 == D);
    by_p_.set(t.edges[kQ<D>], (kQ<D> + 1) % 3 == D);
  }

  VOXDAG_INLINE HeightBounds bounds(int edge, int p, int q, int brick) const {
    const __m128i words =
        _mm_packs_epi32(by_q_.bounds(edge, q, brick), by_p_.bounds(edge, p, brick));
    const __m256i bytes = _mm256_broadcastsi128_si256(_mm_packus_epi16(words, words));
    return _mm256_max_epu8(_mm256_shuffle_epi8(bytes, order(0, by_q_.over[edge])),
                           _mm256_shuffle_epi8(bytes, order(1, by_p_.over[edge])));
  }

 private:
  // The three edges in one projection.
  struct Projection {
    __m256d lanes[3];            // -across times 0, 1, 2, 3
    double inverse[3], more[3];  // 1 / |up|, and what is added then
    int64_t c[3], across4[3], up4[3];
    bool over[3];  // up < 0: the edge bounds heights from above

    VOXDAG_INLINE void set(const Edge (&edges)[3], bool swap) {
      for (int i = 0; i < 3; ++i) {
        const int64_t across = swap ? edges[i].b : edges[i].a;
        const int64_t up = swap ? edges[i].a : edges[i].b;
        c[i] = edges[i].c;
        across4[i] = 4 * across;
        up4[i] = 4 * up;
        over[i] = up < 0;
        lanes[i] =
            _mm256_mul_pd(_mm256_set1_pd(static_cast<double>(-across)), _mm256_setr_pd(0, 1, 2, 3));
        inverse[i] = up == 0 ? 0x1p60 : 1.0 / static_cast<double>(magnitude(up));
        // `below` is ceil(...) - 1 = floor(... - 2^-30); `over` is 15 + ceil(...).
        more[i] = (up < 0 ? kMaxHeight + 1 : 0) - 0x1p-30;
      }
    }
    VOXDAG_INLINE __m128i bounds(int i, int k, int brick) const {
      const int64_t t = -(c[i] + across4[i] * k + up4[i] * brick);
      const __m256d quotients =
          _mm256_mul_pd(_mm256_add_pd(_mm256_set1_pd(static_cast<double>(t)), lanes[i]),
                        _mm256_set1_pd(inverse[i]));
      const __m256d bounds = _mm256_add_pd(quotients, _mm256_set1_pd(more[i]));
      // A negative value, or one too small for an integer, is no bound after the conversion either.
      return _mm256_cvttpd_epi32(_mm256_min_pd(bounds, _mm256_set1_pd(100.0)));
    }
  };

  static VOXDAG_INLINE __m256i order(int of_p, bool over) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(kSideOrder.byte[of_p][over]));
  }

  Projection by_q_, by_p_;
};

}  // namespace
}  // namespace voxdag::cpu
