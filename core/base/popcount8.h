// Counts the bits set in a byte, with a table. x86-64 without extensions has no instruction for
// this, so std::popcount would be a function call.
#pragma once

#include <cstdint>

namespace voxdag {

// The table is a plain array because indexing a std::array calls an inline function. Sources
// compiled for different instruction sets would share one copy of that function, and the CPU might
// not be able to run this copy.
struct Popcount8Table {
  uint8_t of[256] = {};
  constexpr Popcount8Table() {
    for (int bits = 1; bits < 256; ++bits) of[bits] = static_cast<uint8_t>(of[bits / 2] + bits % 2);
  }
};
inline constexpr Popcount8Table kPopcount8Table;
inline constexpr const uint8_t (&kPopcount8)[256] = kPopcount8Table.of;

// Returns the number of ones in the lowest eight bits.
inline int popcount8(uint32_t bits) { return kPopcount8[bits & 0xff]; }

}  // namespace voxdag
