// Integer arithmetic of the color rule. Products are exact, or exact modulo 2^64 if the final
// result is known to fit. Conversions to doubles round in the same way on every machine.
#pragma once

#include <cstdint>
#include <type_traits>

#include "core/base/host_device.h"
#include "core/base/integers.h"

// All code that uses SSE2 also exists as plain code with the same results.
#ifdef VOXDAG_SSE2
#include <emmintrin.h>
#endif

namespace voxdag::color {

template <class Int>
using UnsignedOf = std::conditional_t<sizeof(Int) == 8, uint64_t, uint128>;

// Products and sums modulo 2^64 (for int128, 2^128). They are for expressions whose result fits in
// Int, although intermediate values can exceed the range of Int.
template <class Int>
VOXDAG_HD inline Int wrapping_product(Int a, Int b) {
  return static_cast<Int>(static_cast<UnsignedOf<Int>>(a) * static_cast<UnsignedOf<Int>>(b));
}
template <class Int>
VOXDAG_HD inline Int wrapping_sum(Int a, Int b) {
  return static_cast<Int>(static_cast<UnsignedOf<Int>>(a) + static_cast<UnsignedOf<Int>>(b));
}

template <class Int>
VOXDAG_HD inline Int magnitude(Int x) {
  return x < 0 ? -x : x;
}
template <class Int>
VOXDAG_HD inline Int positive_part(Int x) {
  return x > 0 ? x : 0;
}
template <class Int>
VOXDAG_HD inline Int negative_part(Int x) {
  return x < 0 ? x : 0;
}

// Numbers that fit in 64 bits are rounded to nearest, once. Other 128-bit numbers are converted as
// two halves, because compilers convert 128-bit numbers with different library functions.
VOXDAG_HD inline double to_double(int64_t x) { return static_cast<double>(x); }
VOXDAG_HD inline double to_double(int128 x) {
  const int64_t low = static_cast<int64_t>(x);
  if (low == x) return static_cast<double>(low);
  return static_cast<double>(static_cast<int64_t>(x >> 64)) * 0x1p64 +
         static_cast<double>(static_cast<uint64_t>(x));
}

// Returns floor(x) for |x| below 2^62.
VOXDAG_HD inline int64_t floor_of(double x) {
  const int64_t whole = static_cast<int64_t>(x);
  return static_cast<double>(whole) > x ? whole - 1 : whole;
}

}  // namespace voxdag::color
