#include "core/backend/cpu/raster/kernels.h"

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/list_blocks.h"
#include "core/backend/cpu/raster/flood.h"

namespace voxdag::cpu {
namespace {

// Computes block_key() of a block, eight bricks per step, and tests whether the block has voxels.
BlockSummary summarize(const VoxelBlock& block) {
  const __m512i bricks = _mm512_load_si512(&block);
  const __m512i sums = _mm512_add_epi32(bricks, _mm512_load_si512(kBlockKeys.add));
  const __m512i eight = _mm512_mul_epu32(sums, _mm512_srli_epi64(sums, 32));
  const __m256i four =
      _mm256_add_epi64(_mm512_castsi512_si256(eight), _mm512_extracti64x4_epi64(eight, 1));
  return {sum_of(four), _cvtmask8_u32(_mm512_test_epi64_mask(bricks, bricks)) != 0};
}

int list_blocks(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                uint64_t* keys) {
  return list_blocks_with(tile, groups, existing, numbers, keys, summarize);
}

VoxelBlockContent unpack(const VoxelBlock& block, uint64_t* out) {
  const __m512i bricks = _mm512_load_si512(&block);
  const __mmask8 mask = _mm512_test_epi64_mask(bricks, bricks);
  _mm512_storeu_si512(out, _mm512_maskz_compress_epi64(mask, bricks));
  uint64_t voxels = 0;
  for (const uint64_t brick : block.bricks) voxels += static_cast<uint64_t>(_mm_popcnt_u64(brick));
  return {_cvtmask8_u32(mask), static_cast<uint32_t>(voxels)};
}

void find_components(const VoxelBlock& block, const int32_t (&classes)[8], BlockComponents& out) {
  find_components_with<7>(block, classes, out);
}

void flood(const Slices& empty, Slices& reached) { flood_with(empty, reached); }

uint32_t add_slices(const Slices& voxels, VoxelBlock& block) {
  return add_slices_with(voxels, block);
}

}  // namespace

const Kernels* avx512_kernels() {
  static const bool supported =
      __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512vbmi") && avx2_kernels() != nullptr;
  if (!supported) return nullptr;
  static const Kernels kernels = [] {
    Kernels table = *avx2_kernels();
    table.name = "avx512";
    table.draw = draw_avx512;
    table.draw_thin = draw_thin_avx512;
    table.list_blocks = list_blocks;
    table.unpack = unpack;
    table.find_components = find_components;
    table.flood = flood;
    table.add_slices = add_slices;
    return table;
  }();
  return &kernels;
}

}  // namespace voxdag::cpu
