// The footprint of a triangle: the voxel columns, and the columns of bricks, inside the triangle's
// edges in the projection along the columns. The footprint is also limited to the triangle's box.
// The footprint is exact, because it applies the overlap test's edge and box tests in this
// projection.
//
// A row of bricks is processed as four rows of 64 voxel columns, one bit for each voxel column. In
// each of the four rows, the triangle's edges and box give the first and the last voxel column of
// the footprint (edge_bounds.h).
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/edge_bounds.h"
#include "core/backend/cpu/raster/avx2/tile_columns.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

// Determines which columns of bricks a Footprint lists: kInside for the rule kShell, kTouched for
// the rule kThin. (The rules also have different edges: see tile_triangle.h and thin_triangle.h.)
enum class FootprintColumns {
  // `columns` has the columns of bricks that have a voxel column inside; `full` is empty.
  kInside,
  // Both lists together have the columns of bricks that the triangle touches, even if no voxel
  // column is inside. If all voxel columns are inside, the column of bricks is in `full`.
  kTouched,
};

template <int D>
struct Footprint {
  ColumnList columns, full;
  // inside[q][p] is the set of voxel columns inside the footprint, in the column of bricks (p, q).
  // Bit i + 4 j is voxel column (i, j). Only rows q that occur in the lists are set.
  alignas(32) uint16_t inside[16][16];

  VOXDAG_INLINE Footprint(const TileTriangle<int32_t>& t, FootprintColumns listed) {
    const int first = t.first_voxel[Q] / 4, last = t.last_voxel[Q] / 4;
    if (t.inside) {
      for (int q = first; q <= last; ++q) {
        (listed == FootprintColumns::kTouched ? full : columns)
            .add(q, t.first_voxel[P] / 4, t.last_voxel[P] / 4);
        store(inside[q], _mm256_set1_epi8(-1));
      }
      return;
    }
    const EdgeBounds bounds(t.edges[D], (D + 1) % 3 == P, 1, 64);
    const EdgeBounds touching = bounds.widened();
    const __m256d low = _mm256_set1_pd(t.first_voxel[P]);
    const __m256d high = _mm256_set1_pd(63 - t.last_voxel[P]);
    const __m256d low_q = _mm256_set1_pd(t.first_voxel[Q]);
    const __m256d high_q = _mm256_set1_pd(t.last_voxel[Q]);
    const __m256i ones = _mm256_set1_epi8(-1);
    for (int q = first; q <= last; ++q) {
      const __m256d k = load_doubles(kDoubles.of + 4 * q);
      const __m256d in_box =
          _mm256_and_pd(_mm256_cmp_pd(k, low_q, _CMP_GE_OQ), _mm256_cmp_pd(k, high_q, _CMP_LE_OQ));
      const auto rows_within = [&](const EdgeBounds& edges) __attribute__((always_inline)) {
        const __m256i from = count(_mm256_max_pd(edges.below(k), low));
        const __m256i over = count(_mm256_max_pd(edges.over(k), high));
        return _mm256_and_si256(
            _mm256_castpd_si256(in_box),
            _mm256_and_si256(_mm256_sllv_epi64(ones, from), _mm256_srlv_epi64(ones, over)));
      };
      const __m256i rows = rows_within(bounds);
      if (listed == FootprintColumns::kTouched)
        add_touched(q, any_of_four(rows_within(touching)), all_of_four(rows));
      else
        add_inside(q, any_of_four(rows));
      const __m256i bytes = bytes_of_bricks(rows);
      store(inside[q], interleaved(_mm256_permute4x64_epi64(bytes, 0b11'01'10'00)));
    }
  }

 private:
  static constexpr int P = kP<D>, Q = kQ<D>;

  // The triangle is convex. So all columns of bricks between the first and the last one that has
  // voxel columns inside also have voxel columns inside. The same holds for touched columns and for
  // columns with all voxel columns inside. `any` and `all` are the sets of voxel columns that are
  // set in any row, or in all rows, of row q of the columns of bricks.
  VOXDAG_INLINE void add_inside(int q, uint64_t any) {
    if (any != 0) columns.add(q, first_of(any), last_of(any));
  }
  VOXDAG_INLINE void add_touched(int q, uint64_t any, uint64_t all) {
    if (any == 0) return;
    const int first = first_of(any), last = last_of(any);
    all &= all >> 1;
    all &= all >> 2 & 0x1111111111111111;
    // No branch depends on `all`, because the CPU would mispredict it.
    const int first_full = all != 0 ? first_of(all | uint64_t{1} << 63) : last + 1;
    const int last_full = all != 0 ? last_of(all | 1) : last;
    columns.add(q, first, first_full - 1);
    full.add(q, first_full, last_full);
    columns.add(q, last_full + 1, last);
  }
  static VOXDAG_INLINE int first_of(uint64_t any) { return __builtin_ctzll(any) / 4; }
  static VOXDAG_INLINE int last_of(uint64_t any) { return (63 - __builtin_clzll(any)) / 4; }

  static VOXDAG_INLINE void store(uint16_t (&row)[16], __m256i bits) {
    _mm256_store_si256(reinterpret_cast<__m256i*>(row), bits);
  }
  // Converts a bound (edge_bounds.h) of each of four rows to a shift count, at most 64. Shifting
  // the row's 64 bits by this count clears the voxels outside the bound.
  static VOXDAG_INLINE __m256i count(__m256d x) {
    return _mm256_cvtepi32_epi64(_mm256_cvttpd_epi32(_mm256_min_pd(x, _mm256_set1_pd(64.0))));
  }
  // Returns the voxel columns that are set in any of four rows of 64 voxel columns.
  static VOXDAG_INLINE uint64_t any_of_four(__m256i rows) {
    const __m128i two =
        _mm_or_si128(_mm256_castsi256_si128(rows), _mm256_extracti128_si256(rows, 1));
    return static_cast<uint64_t>(_mm_cvtsi128_si64(two)) |
           static_cast<uint64_t>(_mm_extract_epi64(two, 1));
  }
  // Returns the voxel columns that are set in all of four rows of 64 voxel columns.
  static VOXDAG_INLINE uint64_t all_of_four(__m256i rows) {
    const __m128i two =
        _mm_and_si128(_mm256_castsi256_si128(rows), _mm256_extracti128_si256(rows, 1));
    return static_cast<uint64_t>(_mm_cvtsi128_si64(two)) &
           static_cast<uint64_t>(_mm_extract_epi64(two, 1));
  }
  // Interleaves the lower eight and the upper eight bytes of each 16-byte half.
  static VOXDAG_INLINE __m256i interleaved(__m256i x) {
    return _mm256_unpacklo_epi8(x, _mm256_srli_si256(x, 8));
  }
  // Converts four rows of 64 voxels to bytes. The lower half of the result has a byte for each of
  // the 16 bricks, with the voxels of the brick in the first two rows. The upper half has the same
  // for the other two rows. A byte of a row has four voxels of one brick, then four voxels of the
  // next brick. So a pair of bytes from two rows has four nibbles, and this function exchanges the
  // middle two.
  static VOXDAG_INLINE __m256i bytes_of_bricks(__m256i rows) {
    const __m256i pairs = interleaved(rows);
    const __m256i differ = _mm256_and_si256(_mm256_xor_si256(pairs, _mm256_srli_epi16(pairs, 4)),
                                            _mm256_set1_epi16(0x00f0));
    return _mm256_xor_si256(pairs, _mm256_xor_si256(differ, _mm256_slli_epi16(differ, 4)));
  }
};

}  // namespace
}  // namespace voxdag::cpu
