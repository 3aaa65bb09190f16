// Implements Kernels::list_blocks for AVX2 and AVX-512. The two differ only in how they summarize a
// voxel block.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/tile_columns.h"
#include "core/backend/cpu/raster/tile_bricks.h"

namespace voxdag::cpu {
namespace {

VOXDAG_INLINE uint64_t sum_of(__m256i four) {
  const __m128i two =
      _mm_add_epi64(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
  return static_cast<uint64_t>(_mm_cvtsi128_si64(two)) +
         static_cast<uint64_t>(_mm_extract_epi64(two, 1));
}

struct BlockSummary {
  uint64_t key;
  bool has_voxels;
};

// Does the work of Kernels::list_blocks. `summarize(block)` returns a BlockSummary.
template <class Summarize>
VOXDAG_INLINE int list_blocks_with(TileBricks& tile, int groups, uint8_t* existing,
                                   uint16_t* numbers, uint64_t* keys, Summarize summarize) {
  int count = 0;
  for (int group = 0; group < groups; ++group) {
    uint64_t touched;
    uint32_t bits = 0;
    __builtin_memcpy(&touched, tile.touched + 8 * group, 8);
    __builtin_memset(tile.touched + 8 * group, 0, 8);
    for (; touched != 0; touched &= touched - 1) {
      const int i = __builtin_ctzll(touched) / 8;
      const BlockSummary block = summarize(tile.blocks[8 * group + i]);
      // Always writes the block's number and key, because a branch would often be mispredicted. If
      // the block is empty, the next block overwrites them.
      numbers[count] = static_cast<uint16_t>(8 * group + i);
      keys[count] = block.key;
      count += block.has_voxels;
      bits |= uint32_t{block.has_voxels} << i;
    }
    existing[group] = static_cast<uint8_t>(bits);
  }
  return count;
}

}  // namespace
}  // namespace voxdag::cpu
