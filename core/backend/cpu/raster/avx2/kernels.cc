#include "core/backend/cpu/raster/kernels.h"

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/list_blocks.h"
#include "core/backend/cpu/raster/flood.h"
#include "core/backend/cpu/raster/octant_test.h"

namespace voxdag::cpu {
namespace {

struct Avx2Quad {
  __m256d x;

  explicit Avx2Quad(__m256d quad) : x(quad) {}
  explicit Avx2Quad(double all) : x(_mm256_set1_pd(all)) {}
  Avx2Quad(double x0, double x1, double x2, double x3) : x(_mm256_setr_pd(x0, x1, x2, x3)) {}
  // Reads four coordinates. The fourth belongs to other data and is ignored.
  static Avx2Quad load(const int32_t (&v)[3], int64_t origin) {
    const __m128i four = _mm_loadu_si128(reinterpret_cast<const __m128i*>(v));
    const __m128i local = _mm_sub_epi32(four, _mm_set1_epi32(static_cast<int32_t>(origin)));
    return Avx2Quad(_mm256_cvtepi32_pd(local));
  }
  Avx2Quad operator+(const Avx2Quad& o) const { return Avx2Quad(_mm256_add_pd(x, o.x)); }
  Avx2Quad operator-(const Avx2Quad& o) const { return Avx2Quad(_mm256_sub_pd(x, o.x)); }
  Avx2Quad operator*(const Avx2Quad& o) const { return Avx2Quad(_mm256_mul_pd(x, o.x)); }
  Avx2Quad rotated() const { return Avx2Quad(_mm256_permute4x64_pd(x, 0b11'00'10'01)); }
  Avx2Quad clamp_to_zero() const { return Avx2Quad(_mm256_max_pd(x, _mm256_setzero_pd())); }
  uint32_t negative() const { return static_cast<uint32_t>(_mm256_movemask_pd(x)); }
};

Octants test_octants(const NarrowTriangle& triangle, const LatticeCube& cube, bool inside) {
  return OctantTest<Avx2Quad, int32_t>(triangle, cube).run(inside);
}

const __m256i* halves(const VoxelBlock& block) { return reinterpret_cast<const __m256i*>(&block); }

// Computes block_key() of a block, four bricks per step, and tests whether the block has voxels.
BlockSummary summarize(const VoxelBlock& block) {
  const __m256i low = _mm256_load_si256(halves(block));
  const __m256i high = _mm256_load_si256(halves(block) + 1);
  const auto products = [](__m256i bricks, const uint64_t* add) {
    const __m256i sums =
        _mm256_add_epi32(bricks, _mm256_load_si256(reinterpret_cast<const __m256i*>(add)));
    return _mm256_mul_epu32(sums, _mm256_srli_epi64(sums, 32));
  };
  const __m256i four =
      _mm256_add_epi64(products(low, kBlockKeys.add), products(high, kBlockKeys.add + 4));
  const __m256i any = _mm256_or_si256(low, high);
  return {sum_of(four), _mm256_testz_si256(any, any) == 0};
}

int list_blocks(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                uint64_t* keys) {
  return list_blocks_with(tile, groups, existing, numbers, keys, summarize);
}

// For each subset of four bricks: the permutation of 32-bit lanes that moves the bricks of the
// subset to the front without gaps.
struct Packing {
  alignas(32) int32_t lanes[16][8] = {};
  constexpr Packing() {
    for (int set = 0; set < 16; ++set)
      for (int brick = 0, count = 0; brick < 4; ++brick) {
        if ((set >> brick & 1) == 0) continue;
        lanes[set][count++] = 2 * brick;
        lanes[set][count++] = 2 * brick + 1;
      }
  }
};
constexpr Packing kPacking;

VoxelBlockContent unpack(const VoxelBlock& block, uint64_t* bricks) {
  uint32_t mask = 0;
  for (int half = 0; half < 2; ++half) {
    const __m256i four = _mm256_load_si256(halves(block) + half);
    const __m256i empty = _mm256_cmpeq_epi64(four, _mm256_setzero_si256());
    const uint32_t set =
        static_cast<uint32_t>(_mm256_movemask_pd(_mm256_castsi256_pd(empty))) ^ 0xf;
    const __m256i lanes = _mm256_load_si256(reinterpret_cast<const __m256i*>(kPacking.lanes[set]));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(bricks),
                        _mm256_permutevar8x32_epi32(four, lanes));
    bricks += _mm_popcnt_u32(set);
    mask |= set << 4 * half;
  }
  uint64_t voxels = 0;
  for (const uint64_t brick : block.bricks) voxels += static_cast<uint64_t>(_mm_popcnt_u64(brick));
  return {mask, static_cast<uint32_t>(voxels)};
}

void find_in_range(const int64_t* values, int count, int64_t low, int64_t high, uint64_t* bits) {
  const __m256i lows = _mm256_set1_epi64x(low), highs = _mm256_set1_epi64x(high);
  for (int i = 0; i < count; i += 64) {
    uint64_t outside = 0;
    const int end = count - i < 64 ? count - i : 64;
    for (int j = 0; j < end; j += 4) {
      const __m256i x = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(values + i + j));
      const __m256i out =
          _mm256_or_si256(_mm256_cmpgt_epi64(lows, x), _mm256_cmpgt_epi64(x, highs));
      outside |= static_cast<uint64_t>(_mm256_movemask_pd(_mm256_castsi256_pd(out))) << j;
    }
    bits[i / 64] = ~outside & (end < 64 ? (uint64_t{1} << end) - 1 : ~uint64_t{0});
  }
}

void find_components(const VoxelBlock& block, const int32_t (&classes)[8], BlockComponents& out) {
  find_components_with<7>(block, classes, out);
}

void flood(const Slices& empty, Slices& reached) { flood_with(empty, reached); }

uint32_t add_slices(const Slices& voxels, VoxelBlock& block) {
  return add_slices_with(voxels, block);
}

constexpr Kernels kAvx2 = {"avx2",      draw_avx2, draw_thin_avx2,  test_octants, find_in_range,
                           list_blocks, unpack,    find_components, flood,        add_slices};

}  // namespace

const Kernels* avx2_kernels() {
  const bool supported = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                         __builtin_cpu_supports("bmi2");
  return supported ? &kAvx2 : nullptr;
}

}  // namespace voxdag::cpu
