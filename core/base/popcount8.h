// Bits set in a byte. A table, since baseline x86-64 has no instruction for it and std::popcount is
// a call there.
#pragma once

#include <cstdint>

namespace voxdag {

// A plain array: sources compiled for other instruction sets share no inline function through it.
struct Popcount8Table {
  uint8_t of[256] = {};
  constexpr Popcount8Table() {
    for (int bits = 1; bits < 256; ++bits) of[bits] = static_cast<uint8_t>(of[bits / 2] + bits % 2);
  }
};
inline constexpr Popcount8Table kPopcount8Table;
inline constexpr const uint8_t (&kPopcount8)[256] = kPopcount8Table.of;

// Number of ones in the lowest eight bits.
inline int popcount8(uint32_t bits) { return kPopcount8[bits & 0xff]; }

}  // namespace voxdag
