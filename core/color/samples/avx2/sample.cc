// This file is compiled for AVX2, so its functions may run only after a check that the CPU has
// AVX2.
#include <immintrin.h>

#include "core/color/rule/cell_weight.h"
#include "core/color/samples/sample_batch.h"

namespace voxdag::color {
namespace {

constexpr int kPointBits = 30;  // fractional bits of barycentric coordinates
constexpr int64_t kOneTexture = int64_t{1} << kTextureBits;

// Functions with four lanes of 64 bits.
__m256i all(int64_t x) { return _mm256_set1_epi64x(x); }

// Returns the barycentric coordinate of the vertex opposite to an edge, between 0 and 2^30.
__m128i weight_of(const double (&edge)[3], double scale, const SampleBatch& batch, size_t i) {
  const auto term = [](double factor, const int32_t* x) {
    const __m256d wide = _mm256_cvtepi32_pd(_mm_load_si128(reinterpret_cast<const __m128i*>(x)));
    return _mm256_mul_pd(_mm256_set1_pd(factor), wide);
  };
  const __m256d sum =
      _mm256_add_pd(_mm256_add_pd(term(edge[0], &batch.x[i]), term(edge[1], &batch.y[i])),
                    term(edge[2], &batch.count[i]));
  const __m256d mean =
      _mm256_mul_pd(_mm256_mul_pd(sum, _mm256_set1_pd(scale)), _mm256_load_pd(&batch.share[i]));
  const __m256d least = _mm256_max_pd(mean, _mm256_setzero_pd());
  return _mm256_cvttpd_epi32(_mm256_min_pd(least, _mm256_set1_pd(0x1p30)));
}

// Wraps coordinates into [0, 2^kTextureBits].
__m256i wrapped(__m256i coordinate, Wrap wrap) {
  if (wrap == Wrap::kRepeat) return _mm256_and_si256(coordinate, all(kOneTexture - 1));
  if (wrap == Wrap::kMirroredRepeat) {
    const __m256i in_two = _mm256_and_si256(coordinate, all(2 * kOneTexture - 1));
    return _mm256_min_epu32(in_two, _mm256_sub_epi64(all(2 * kOneTexture), in_two));
  }
  const __m256i is_above = _mm256_cmpgt_epi64(coordinate, all(kOneTexture));
  const __m256i is_below = _mm256_cmpgt_epi64(_mm256_setzero_si256(), coordinate);
  return _mm256_andnot_si256(is_below, _mm256_blendv_epi8(coordinate, all(kOneTexture), is_above));
}

// The two texels next to a coordinate along one axis, and the weight of the second texel.
struct Texels {
  __m256i first, second, fraction;
};
// `coordinate` is between 0 and 2^kTextureBits.
Texels texels_at(__m256i coordinate, Wrap wrap, uint32_t size) {
  // Half a texel is added instead of subtracted, so that no number is negative. So the integer part
  // is the second texel.
  const __m256i position = _mm256_add_epi64(_mm256_mul_epu32(coordinate, all(size)),
                                            all(int64_t{1} << (kTextureBits - 1)));
  const __m256i number = _mm256_srli_epi64(position, kTextureBits);
  const __m256i is_before = _mm256_cmpeq_epi64(number, _mm256_setzero_si256());
  const __m256i is_behind = _mm256_cmpeq_epi64(number, all(size));
  Texels texels;
  texels.fraction = _mm256_and_si256(_mm256_srli_epi64(position, kTextureBits - 8), all(255));
  const __m256i before = _mm256_sub_epi64(number, all(1));
  if (wrap == Wrap::kRepeat) {
    texels.first = _mm256_blendv_epi8(before, all(int64_t{size} - 1), is_before);
    texels.second = _mm256_andnot_si256(is_behind, number);
  } else {
    texels.first = _mm256_andnot_si256(is_before, before);
    texels.second = _mm256_add_epi64(number, is_behind);
  }
  return texels;
}

// Returns the position of texel number `at` in a row of texels.
__m256i column_of(__m256i at) {
  const __m256i tile = _mm256_slli_epi64(_mm256_srli_epi64(at, kTileShift), 2 * kTileShift);
  return _mm256_add_epi64(tile, _mm256_and_si256(at, all(kTileEdge - 1)));
}
// Returns the position of row number `at` in a level.
__m256i row_of(__m256i at, uint32_t row_of_tiles) {
  const __m256i tile = _mm256_mul_epu32(_mm256_srli_epi64(at, kTileShift), all(row_of_tiles));
  return _mm256_add_epi64(tile,
                          _mm256_slli_epi64(_mm256_and_si256(at, all(kTileEdge - 1)), kTileShift));
}

void store(uint64_t* to, __m256i x) { _mm256_store_si256(reinterpret_cast<__m256i*>(to), x); }

void find_texels(const SampledSurface& surface, SampleBatch& batch, size_t cells) {
  const TiledLevel& level = surface.level;
  for (size_t i = 0; i < cells; i += 4) {
    const __m128i second = weight_of(surface.edges[0], surface.scale, batch, i);
    const __m128i third = _mm_min_epi32(weight_of(surface.edges[1], surface.scale, batch, i),
                                        _mm_sub_epi32(_mm_set1_epi32(1 << kPointBits), second));
    const __m256i weights[2] = {_mm256_cvtepu32_epi64(second), _mm256_cvtepu32_epi64(third)};
    const auto along = [&](int axis, uint32_t size) {
      // 2^62 makes the sum positive, because the shift fills in zeros.
      const __m256i change = _mm256_add_epi64(
          _mm256_add_epi64(_mm256_mul_epi32(weights[0], all(surface.change[axis][0])),
                           _mm256_mul_epi32(weights[1], all(surface.change[axis][1]))),
          all(int64_t{1} << 62));
      const __m256i coordinate =
          _mm256_add_epi64(_mm256_srli_epi64(change, kPointBits),
                           all(surface.texture[axis] - (int64_t{1} << (62 - kPointBits))));
      const Wrap wrap = surface.wrap[axis];
      return texels_at(wrapped(coordinate, wrap), wrap, size);
    };
    const Texels x = along(0, level.width), y = along(1, level.height);
    store(&batch.columns[0][i], column_of(x.first));
    store(&batch.columns[1][i], column_of(x.second));
    store(&batch.rows[0][i], row_of(y.first, level.row_of_tiles));
    store(&batch.rows[1][i], row_of(y.second, level.row_of_tiles));
    store(&batch.fractions[0][i], x.fraction);
    store(&batch.fractions[1][i], y.fraction);
  }
  for (size_t i = 0; i < cells; ++i) {
    __builtin_prefetch(&level.texels[batch.rows[0][i] + batch.columns[0][i]]);
    __builtin_prefetch(&level.texels[batch.rows[1][i] + batch.columns[0][i]]);
  }
}

// Functions with lanes of 32 bits: the channels of a cell, and then those of the next cell.

// Returns the texels of two cells at these positions.
__m256i texels_of(const uint64_t* texels, const uint64_t* row, const uint64_t* column) {
  const __m128i two = _mm_set_epi64x(static_cast<int64_t>(texels[row[1] + column[1]]),
                                     static_cast<int64_t>(texels[row[0] + column[0]]));
  return _mm256_cvtepu16_epi32(two);
}
__m256i of_two(__m128i values, __m256i lanes) {
  return _mm256_permutevar8x32_epi32(_mm256_castsi128_si256(values), lanes);
}
// Returns 256 a + fraction (b - a), which is (256 - fraction) a + fraction b. All sums are modulo
// 2^32; the result is not negative.
__m256i mixed(__m256i a, __m256i b, __m256i fraction) {
  return _mm256_add_epi32(_mm256_slli_epi32(a, 8),
                          _mm256_mullo_epi32(_mm256_sub_epi32(b, a), fraction));
}
// Returns a b / 65535, rounded to nearest.
__m256i scaled(__m256i a, __m256i b) {
  const __m256i product = _mm256_add_epi32(_mm256_mullo_epi32(a, b), _mm256_set1_epi32(32768));
  return _mm256_srli_epi32(_mm256_add_epi32(product, _mm256_srli_epi32(product, 16)), 16);
}

uint32_t blend(const SampledSurface& surface, SampleBatch& batch, size_t cells) {
  const __m256i first_lanes = _mm256_setr_epi32(0, 0, 0, 0, 2, 2, 2, 2),
                count_lanes = _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1);
  const __m256i tint =
      _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(surface.tint)));
  const __m256i column_weight = _mm256_set1_epi32(static_cast<int32_t>(surface.column_weight));
  uint32_t not_full = 0;
  for (size_t i = 0; i < cells; i += 2) {
    const auto fraction = [&](int axis) {
      return of_two(_mm_load_si128(reinterpret_cast<const __m128i*>(&batch.fractions[axis][i])),
                    first_lanes);
    };
    const auto texels = [&](int row, int column) {
      return texels_of(surface.level.texels, &batch.rows[row][i], &batch.columns[column][i]);
    };
    const __m256i x = fraction(0);
    const __m256i sum = mixed(mixed(texels(0, 0), texels(0, 1), x),
                              mixed(texels(1, 0), texels(1, 1), x), fraction(1));
    __m256i color = _mm256_srli_epi32(_mm256_add_epi32(sum, _mm256_set1_epi32(32768)), 16);
    const __m256i is_full = _mm256_cmpeq_epi32(color, _mm256_set1_epi32(65535));
    const int mask = _mm256_movemask_ps(_mm256_castsi256_ps(is_full));
    not_full |= static_cast<uint32_t>((~mask >> 3 & 1) | (~mask >> 6 & 2)) << i;
    if (surface.has_tint) color = scaled(color, tint);
    const __m256i weight = _mm256_mullo_epi32(
        of_two(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&batch.count[i])), count_lanes),
        column_weight);
    const __m256i kind =
        _mm256_add_epi32(_mm256_slli_epi32(weight, CellWeight::kIndexBits),
                         _mm256_set1_epi32(static_cast<int32_t>(CellWeight::kOpaque)));
    _mm256_store_si256(reinterpret_cast<__m256i*>(batch.weighted[i]),
                       _mm256_blend_epi32(_mm256_mullo_epi32(color, weight), kind, 0b10001000));
  }
  return not_full;
}

constexpr SampleKernels kKernels{find_texels, blend};

}  // namespace

const SampleKernels* sample_kernels_avx2() {
  return __builtin_cpu_supports("avx2") ? &kKernels : nullptr;
}

}  // namespace voxdag::color
