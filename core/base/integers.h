// 128-bit integers (available in g++, clang and nvcc), and functions that mix the bits of a number.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

__extension__ typedef __int128 int128;
__extension__ typedef unsigned __int128 uint128;

// Returns the high half of the product xored into its low half: the mixing step of the node hash.
VOXDAG_HD inline uint64_t fold_multiply(uint64_t a, uint64_t b) {
  const uint128 product = static_cast<uint128>(a) * b;
  return static_cast<uint64_t>(product) ^ static_cast<uint64_t>(product >> 64);
}

// A bijective mix of all bits: the output function of splitmix64, the generator of random numbers.
VOXDAG_HD inline uint64_t mix_bits(uint64_t x) {
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ x >> 27) * 0x94d049bb133111ebull;
  return x ^ x >> 31;
}

}  // namespace voxdag
