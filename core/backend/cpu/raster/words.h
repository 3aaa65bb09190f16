// Eight words of 64 bits for flood.h, with the operators of vectors and moves between lanes.
//
// If the source that includes this header is compiled for AVX-512, the words are one vector.
// Otherwise they are two vectors of four words, the size of AVX2's vectors: for larger vectors than
// the instruction set has, GCC compiles shuffles to slow code, which moves single words through
// memory. All functions have internal linkage and are inlined, so each instruction set has its own
// code.
#pragma once

#include <cstdint>

#define VOXDAG_SLICES_INLINE [[gnu::always_inline]] static inline

namespace voxdag::cpu::slices {

#ifdef __AVX512F__

using Words = uint64_t __attribute__((vector_size(64)));

VOXDAG_SLICES_INLINE uint64_t word(const Words& words, int i) { return words[i]; }
// Returns words that are 0, except for the words 0 and kLast (3 or 7).
template <int kLast>
VOXDAG_SLICES_INLINE Words end_words(uint64_t first, uint64_t last) {
  return Words{first, 0, 0, kLast == 3 ? last : 0, 0, 0, 0, kLast == 7 ? last : 0};
}
VOXDAG_SLICES_INLINE bool is_zero(const Words& words) {
  const auto half = __builtin_shufflevector(words, words, 0, 1, 2, 3) |
                    __builtin_shufflevector(words, words, 4, 5, 6, 7);
  return (half[0] | half[1] | half[2] | half[3]) == 0;
}
// Return `words` with lanes exchanged that are one or two lanes apart.
VOXDAG_SLICES_INLINE Words swap_one(const Words& words) {
  return __builtin_shufflevector(words, words, 1, 0, 3, 2, 5, 4, 7, 6);
}
VOXDAG_SLICES_INLINE Words swap_two(const Words& words) {
  return __builtin_shufflevector(words, words, 2, 3, 0, 1, 6, 7, 4, 5);
}
// Return `words` moved by `kLanes` lanes (1, 2 or 4) to higher or to lower lanes.
template <int kLanes>
VOXDAG_SLICES_INLINE Words move_up(const Words& words) {
  constexpr Words k0{};
  constexpr int k = 8 - kLanes;
  return __builtin_shufflevector(k0, words, k, k + 1, k + 2, k + 3, k + 4, k + 5, k + 6, k + 7);
}
template <int kLanes>
VOXDAG_SLICES_INLINE Words move_down(const Words& words) {
  constexpr Words k0{};
  constexpr int k = kLanes;
  return __builtin_shufflevector(words, k0, k, k + 1, k + 2, k + 3, k + 4, k + 5, k + 6, k + 7);
}

#else

using Half = uint64_t __attribute__((vector_size(32)));

struct Halves {
  Half low, high;  // the words 0-3 and 4-7
};
using Words = Halves;

VOXDAG_SLICES_INLINE Words operator~(const Words& a) { return {~a.low, ~a.high}; }
VOXDAG_SLICES_INLINE Words operator|(const Words& a, const Words& b) {
  return {a.low | b.low, a.high | b.high};
}
VOXDAG_SLICES_INLINE Words operator&(const Words& a, const Words& b) {
  return {a.low & b.low, a.high & b.high};
}
VOXDAG_SLICES_INLINE Words operator^(const Words& a, const Words& b) {
  return {a.low ^ b.low, a.high ^ b.high};
}
VOXDAG_SLICES_INLINE Words operator&(const Words& a, uint64_t b) { return {a.low & b, a.high & b}; }
VOXDAG_SLICES_INLINE Words operator<<(const Words& a, int bits) {
  return {a.low << bits, a.high << bits};
}
VOXDAG_SLICES_INLINE Words operator>>(const Words& a, int bits) {
  return {a.low >> bits, a.high >> bits};
}

VOXDAG_SLICES_INLINE uint64_t word(const Words& words, int i) {
  return i < 4 ? words.low[i] : words.high[i - 4];
}
template <int kLast>
VOXDAG_SLICES_INLINE Words end_words(uint64_t first, uint64_t last) {
  return {Half{first, 0, 0, kLast == 3 ? last : 0}, Half{0, 0, 0, kLast == 7 ? last : 0}};
}
VOXDAG_SLICES_INLINE bool is_zero(const Words& words) {
  const Half both = words.low | words.high;
  return (both[0] | both[1] | both[2] | both[3]) == 0;
}
VOXDAG_SLICES_INLINE Words swap_one(const Words& words) {
  return {__builtin_shufflevector(words.low, words.low, 1, 0, 3, 2),
          __builtin_shufflevector(words.high, words.high, 1, 0, 3, 2)};
}
VOXDAG_SLICES_INLINE Words swap_two(const Words& words) {
  return {__builtin_shufflevector(words.low, words.low, 2, 3, 0, 1),
          __builtin_shufflevector(words.high, words.high, 2, 3, 0, 1)};
}
template <int kLanes>
VOXDAG_SLICES_INLINE Words move_up(const Words& words) {
  constexpr Half k0{};
  if constexpr (kLanes == 4) return {k0, words.low};
  constexpr int k = 4 - kLanes % 4;
  return {__builtin_shufflevector(k0, words.low, k, k + 1, k + 2, k + 3),
          __builtin_shufflevector(words.low, words.high, k, k + 1, k + 2, k + 3)};
}
template <int kLanes>
VOXDAG_SLICES_INLINE Words move_down(const Words& words) {
  constexpr Half k0{};
  if constexpr (kLanes == 4) return {words.high, k0};
  constexpr int k = kLanes % 4;
  return {__builtin_shufflevector(words.low, words.high, k, k + 1, k + 2, k + 3),
          __builtin_shufflevector(words.high, k0, k, k + 1, k + 2, k + 3)};
}

#endif

}  // namespace voxdag::cpu::slices
