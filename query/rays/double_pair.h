// Two doubles that one operation processes together: with SSE2, which every x86-64 CPU has, or in
// plain C++ on other CPUs. Each operation rounds like the same operation on one double.
#pragma once

#include <cmath>
#include <cstdint>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace voxdag::query {

#ifdef __SSE2__

struct DoublePair {
  __m128d v;
  static DoublePair load(const double* aligned) { return {_mm_load_pd(aligned)}; }
  static DoublePair of(double both) { return {_mm_set1_pd(both)}; }
  static DoublePair from(const int32_t* two) {
    return {_mm_cvtepi32_pd(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(two)))};
  }
  void store(double* aligned) const { _mm_store_pd(aligned, v); }
};
inline DoublePair operator+(DoublePair a, DoublePair b) { return {_mm_add_pd(a.v, b.v)}; }
inline DoublePair operator-(DoublePair a, DoublePair b) { return {_mm_sub_pd(a.v, b.v)}; }
inline DoublePair operator*(DoublePair a, DoublePair b) { return {_mm_mul_pd(a.v, b.v)}; }
inline DoublePair operator/(DoublePair a, DoublePair b) { return {_mm_div_pd(a.v, b.v)}; }
inline DoublePair square_root(DoublePair a) { return {_mm_sqrt_pd(a.v)}; }
inline DoublePair absolute(DoublePair a) { return {_mm_andnot_pd(_mm_set1_pd(-0.0), a.v)}; }
inline DoublePair max(DoublePair a, DoublePair b) { return {_mm_max_pd(a.v, b.v)}; }
inline DoublePair min(DoublePair a, DoublePair b) { return {_mm_min_pd(a.v, b.v)}; }
// firsts() returns the first number of `a` twice, seconds() the second number twice. first_second()
// returns the first number of `a` and the second number of `b`.
inline DoublePair firsts(DoublePair a) { return {_mm_unpacklo_pd(a.v, a.v)}; }
inline DoublePair seconds(DoublePair a) { return {_mm_unpackhi_pd(a.v, a.v)}; }
inline DoublePair first_second(DoublePair a, DoublePair b) { return {_mm_shuffle_pd(a.v, b.v, 2)}; }
// Returns a mask: bit 0 is the result for the first numbers of the pairs, bit 1 for the second.
inline unsigned less(DoublePair a, DoublePair b) {
  return static_cast<unsigned>(_mm_movemask_pd(_mm_cmplt_pd(a.v, b.v)));
}
inline unsigned equal(DoublePair a, DoublePair b) {
  return static_cast<unsigned>(_mm_movemask_pd(_mm_cmpeq_pd(a.v, b.v)));
}

#else

struct DoublePair {
  double a, b;
  static DoublePair load(const double* aligned) { return {aligned[0], aligned[1]}; }
  static DoublePair of(double both) { return {both, both}; }
  static DoublePair from(const int32_t* two) {
    return {static_cast<double>(two[0]), static_cast<double>(two[1])};
  }
  void store(double* to) const {
    to[0] = a;
    to[1] = b;
  }
};
inline DoublePair firsts(DoublePair x) { return {x.a, x.a}; }
inline DoublePair seconds(DoublePair x) { return {x.b, x.b}; }
inline DoublePair first_second(DoublePair x, DoublePair y) { return {x.a, y.b}; }
inline DoublePair operator+(DoublePair x, DoublePair y) { return {x.a + y.a, x.b + y.b}; }
inline DoublePair operator-(DoublePair x, DoublePair y) { return {x.a - y.a, x.b - y.b}; }
inline DoublePair operator*(DoublePair x, DoublePair y) { return {x.a * y.a, x.b * y.b}; }
inline DoublePair operator/(DoublePair x, DoublePair y) { return {x.a / y.a, x.b / y.b}; }
inline DoublePair square_root(DoublePair x) { return {std::sqrt(x.a), std::sqrt(x.b)}; }
inline DoublePair absolute(DoublePair x) { return {std::fabs(x.a), std::fabs(x.b)}; }
inline DoublePair max(DoublePair x, DoublePair y) {
  return {x.a > y.a ? x.a : y.a, x.b > y.b ? x.b : y.b};
}
inline DoublePair min(DoublePair x, DoublePair y) {
  return {x.a < y.a ? x.a : y.a, x.b < y.b ? x.b : y.b};
}
inline unsigned less(DoublePair x, DoublePair y) {
  return (x.a < y.a ? 1u : 0u) | (x.b < y.b ? 2u : 0u);
}
inline unsigned equal(DoublePair x, DoublePair y) {
  return (x.a == y.a ? 1u : 0u) | (x.b == y.b ? 2u : 0u);
}

#endif

}  // namespace voxdag::query
