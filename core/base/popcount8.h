// Counts the bits set in a byte, with a table. x86-64 without extensions has no instruction for
// counting bits, so std::popcount would be a function call.
#pragma once

#include <cstdint>

namespace voxdag {

// The table is a plain array because indexing a std::array calls an inline function. The linker
// keeps only one copy of an inline function, even if sources are compiled for different instruction
// sets. The CPU might not be able to run the copy that is kept.
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
