#include "core/backend/cpu/kernels.h"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && \
    defined(__AVX512VL__) && defined(__AVX512VBMI__) && defined(__BMI2__)

#include <immintrin.h>

#include "core/backend/cpu/draw_avx512.h"

namespace voxdag::cpu {
namespace {

// As block_key(), eight bricks at once.
uint64_t key_of(__m512i bricks) {
  const __m512i sums = _mm512_add_epi32(bricks, _mm512_load_si512(kBlockKeys.add));
  const __m512i eight = _mm512_mul_epu32(sums, _mm512_srli_epi64(sums, 32));
  const __m256i four =
      _mm256_add_epi64(_mm512_castsi512_si256(eight), _mm512_extracti64x4_epi64(eight, 1));
  const __m128i two =
      _mm_add_epi64(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
  return static_cast<uint64_t>(_mm_cvtsi128_si64(two)) +
         static_cast<uint64_t>(_mm_extract_epi64(two, 1));
}

int list_blocks(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                uint64_t* keys) {
  int count = 0;
  for (int group = 0; group < groups; ++group) {
    uint64_t touched;
    uint32_t bits = 0;
    __builtin_memcpy(&touched, tile.touched + 8 * group, 8);
    __builtin_memset(tile.touched + 8 * group, 0, 8);
    for (; touched != 0; touched &= touched - 1) {
      const int i = __builtin_ctzll(touched) / 8;
      const __m512i bricks = _mm512_load_si512(&tile.blocks[8 * group + i]);
      // Written in any case, kept if there is something.
      numbers[count] = static_cast<uint16_t>(8 * group + i);
      keys[count] = key_of(bricks);
      const uint32_t there = _cvtmask8_u32(_mm512_test_epi64_mask(bricks, bricks)) != 0;
      count += static_cast<int>(there);
      bits |= there << i;
    }
    existing[group] = static_cast<uint8_t>(bits);
  }
  return count;
}

BlockContent unpack(const Block& block, uint64_t* out) {
  const __m512i bricks = _mm512_load_si512(&block);
  const __mmask8 mask = _mm512_test_epi64_mask(bricks, bricks);
  _mm512_storeu_si512(out, _mm512_maskz_compress_epi64(mask, bricks));
  uint64_t voxels = 0;
  for (const uint64_t brick : block.bricks) voxels += static_cast<uint64_t>(_mm_popcnt_u64(brick));
  return {_cvtmask8_u32(mask), static_cast<uint32_t>(voxels)};
}

void find_in_range(const int64_t* values, int count, int64_t least, int64_t most, uint64_t* bits) {
  const __m512i low = _mm512_set1_epi64(least), high = _mm512_set1_epi64(most);
  for (int i = 0; i < count; i += 64) {
    uint64_t word = 0;
    for (int j = 0; j < 64 && i + j < count; j += 8) {
      const int left = count - i - j;
      const __mmask8 there = static_cast<__mmask8>(left < 8 ? (1 << left) - 1 : 0xff);
      const __m512i x = _mm512_maskz_loadu_epi64(there, values + i + j);
      const __mmask8 inside =
          _mm512_mask_cmple_epi64_mask(_mm512_mask_cmpge_epi64_mask(there, x, low), x, high);
      word |= uint64_t{_cvtmask8_u32(inside)} << j;
    }
    bits[i / 64] = word;
  }
}

}  // namespace

const Kernels* avx512_kernels() {
  static const bool supported =
      __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("fma") &&
      avx2_kernels() != nullptr;
  if (!supported) return nullptr;
  static const Kernels kernels = {"avx512",      draw_avx512, avx2_kernels()->test_octants,
                                  find_in_range, list_blocks, unpack};
  return &kernels;
}

}  // namespace voxdag::cpu

#else

namespace voxdag::cpu {

const Kernels* avx512_kernels() { return nullptr; }

}  // namespace voxdag::cpu

#endif
