// This file is compiled for AVX2. If a CPU lacks one of the instructions that the compiler can use
// here, only walk_packet_avx2() may be called on it, and no other function of this file. So
// walk_packet_avx2() checks the CPU first. It returns a null pointer instead of walk() if an
// instruction is missing.
#include <immintrin.h>

#include "query/rays/packet_walk.h"

namespace voxdag::query {
namespace {

struct Avx2Four {
  __m256d v;
  static Avx2Four load(const double* p) { return {_mm256_load_pd(p)}; }
  static Avx2Four of(double all) { return {_mm256_set1_pd(all)}; }
  static Avx2Four from(Int4 p) { return {_mm256_cvtepi32_pd((__m128i)p)}; }
  void store(double* p) const { _mm256_store_pd(p, v); }
};
VOXDAG_INLINE Avx2Four operator-(Avx2Four x, Avx2Four y) { return {_mm256_sub_pd(x.v, y.v)}; }
VOXDAG_INLINE Avx2Four operator+(Avx2Four x, Avx2Four y) { return {_mm256_add_pd(x.v, y.v)}; }
VOXDAG_INLINE Avx2Four operator*(Avx2Four x, Avx2Four y) { return {_mm256_mul_pd(x.v, y.v)}; }
VOXDAG_INLINE Avx2Four max(Avx2Four x, Avx2Four y) { return {_mm256_max_pd(x.v, y.v)}; }
VOXDAG_INLINE Avx2Four min(Avx2Four x, Avx2Four y) { return {_mm256_min_pd(x.v, y.v)}; }
VOXDAG_INLINE unsigned less(Avx2Four x, Avx2Four y) {
  return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(x.v, y.v, _CMP_LT_OQ)));
}
// Returns the results of two comparisons as a mask of children: `lower` has the results for the
// children that are lower on the y axis, and `upper` for those that are upper.
VOXDAG_INLINE uint32_t children(__m256d lower, __m256d upper) {
  const __m256 both =
      _mm256_shuffle_ps(_mm256_castpd_ps(lower), _mm256_castpd_ps(upper), _MM_SHUFFLE(2, 0, 2, 0));
  return static_cast<uint32_t>(_mm256_movemask_ps(both));
}
VOXDAG_INLINE uint32_t less(Avx2Four x0, Avx2Four y0, Avx2Four x1, Avx2Four y1) {
  return children(_mm256_cmp_pd(x0.v, y0.v, _CMP_LT_OQ), _mm256_cmp_pd(x1.v, y1.v, _CMP_LT_OQ));
}
VOXDAG_INLINE uint32_t equal(Avx2Four x0, Avx2Four y0, Avx2Four x1, Avx2Four y1) {
  return children(_mm256_cmp_pd(x0.v, y0.v, _CMP_EQ_OQ), _mm256_cmp_pd(x1.v, y1.v, _CMP_EQ_OQ));
}
VOXDAG_INLINE Avx2Four first_lane(Avx2Four x) { return {_mm256_permute4x64_pd(x.v, 0x00)}; }
VOXDAG_INLINE Avx2Four middle_lane(Avx2Four x) { return {_mm256_permute4x64_pd(x.v, 0x55)}; }
VOXDAG_INLINE Avx2Four last_lane(Avx2Four x) { return {_mm256_permute4x64_pd(x.v, 0xaa)}; }
VOXDAG_INLINE Avx2Four blend_high(Avx2Four x, Avx2Four y) {
  return {_mm256_blend_pd(x.v, y.v, 0xc)};
}
VOXDAG_INLINE Avx2Four blend_odd(Avx2Four x, Avx2Four y) {
  return {_mm256_blend_pd(x.v, y.v, 0xa)};
}

void walk(PacketJob& job, uint64_t rays) { PacketWalk<Avx2Four>(job, rays).run(rays); }

}  // namespace

WalkPacket walk_packet_avx2() {
  const bool supported = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") &&
                         __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("popcnt");
  return supported ? walk : nullptr;
}

}  // namespace voxdag::query
