// 128-bit integers, which g++, clang and nvcc have, and the one operation on them that the node
// hash needs.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

__extension__ typedef __int128 int128;
__extension__ typedef unsigned __int128 uint128;

// The product's high half xored into its low half: the mixing step of the node hash.
VOXDAG_HD inline uint64_t fold_multiply(uint64_t a, uint64_t b) {
  const uint128 product = static_cast<uint128>(a) * b;
  return static_cast<uint64_t>(product) ^ static_cast<uint64_t>(product >> 64);
}

}  // namespace voxdag
