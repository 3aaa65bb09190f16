// Adds a color to a ColorSum.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/color_sum.h"
#include "core/color/rule/exact.h"
#include "core/color/rule/texture_lookup.h"

namespace voxdag::color {

// Adds `texel` to a sum with the weight `weight`. `seen` is `weight` times alpha. Both are below
// 2^32.
VOXDAG_HD inline void add_weighted_one_by_one(Texel texel, uint64_t weight, uint64_t seen,
                                              ColorSum& sum) {
  for (int c = 0; c < 3; ++c) {
    const uint64_t intensity = channel(texel, c);
    sum.plain[static_cast<size_t>(c)] += weight * intensity;
    sum.seen[static_cast<size_t>(c)] += seen * intensity;
  }
  sum.weight += weight;
  sum.seen_weight += seen;
}
// Does the same as add_weighted_one_by_one(). If SSE2 is available, each of its instructions adds
// to two of the eight sums.
VOXDAG_HD inline void add_weighted(Texel texel, uint64_t weight, uint64_t seen, ColorSum& sum) {
#ifdef VOXDAG_SSE2
  static_assert(sizeof(ColorSum) == 4 * sizeof(__m128i));
  auto* const sums = reinterpret_cast<__m128i*>(&sum);
  const auto add = [](__m128i* to, __m128i more) {
    _mm_storeu_si128(to, _mm_add_epi64(_mm_loadu_si128(to), more));
  };
  // The fourth channel is 1, so that the same products also give the sums of weights.
  const Texel with_one = (texel & 0xffffffffffffull) | Texel{1} << 48;
  const __m128i zero = _mm_setzero_si128();
  const __m128i all = _mm_unpacklo_epi16(_mm_cvtsi64_si128(static_cast<int64_t>(with_one)), zero);
  const __m128i low = _mm_unpacklo_epi32(all, zero), high = _mm_unpackhi_epi32(all, zero);
  const __m128i plain = _mm_set1_epi64x(static_cast<int64_t>(weight)),
                visible = _mm_set1_epi64x(static_cast<int64_t>(seen));
  add(sums, _mm_mul_epu32(low, visible));
  add(sums + 1, _mm_mul_epu32(high, visible));
  add(sums + 2, _mm_mul_epu32(low, plain));
  add(sums + 3, _mm_mul_epu32(high, plain));
#else
  add_weighted_one_by_one(texel, weight, seen, sum);
#endif
}

}  // namespace voxdag::color
