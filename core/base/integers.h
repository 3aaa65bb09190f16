// 128-bit integers (available in g++, clang and nvcc), and functions that mix the bits of a number.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

__extension__ typedef __int128 int128;
__extension__ typedef unsigned __int128 uint128;

// Returns the lower half of the 128-bit product a * b xored with its upper half. This is the mixing
// step of the node hash.
VOXDAG_HD inline uint64_t fold_multiply(uint64_t a, uint64_t b) {
  const uint128 product = static_cast<uint128>(a) * b;
  return static_cast<uint64_t>(product) ^ static_cast<uint64_t>(product >> 64);
}

// Mixes the bits of `x`. Different numbers give different results. This is the output function of
// the random number generator splitmix64.
VOXDAG_HD inline uint64_t mix_bits(uint64_t x) {
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ x >> 27) * 0x94d049bb133111ebull;
  return x ^ x >> 31;
}

}  // namespace voxdag
