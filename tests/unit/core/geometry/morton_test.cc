#include "core/geometry/morton.h"

#include <gtest/gtest.h>

#include <random>

namespace voxdag {
namespace {

// Interleaves the bits one by one, as in the definition.
uint64_t interleave(uint32_t x, uint32_t y, uint32_t z) {
  uint64_t code = 0;
  for (int i = 20; i >= 0; --i)
    code = code << 3 | (x >> i & 1) << 2 | (y >> i & 1) << 1 | (z >> i & 1);
  return code;
}

TEST(Morton, InterleavesAndComesBack) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100000; ++i) {
    // Coordinates have up to 21 bits. Many of them have few bits, so that low bits are also tested
    // alone.
    const int bits = 1 + i % 21;
    const uint32_t mask = (1u << bits) - 1;
    const uint32_t x = random() & mask, y = random() & mask, z = random() & mask;
    const uint64_t code = morton_encode(x, y, z);
    ASSERT_EQ(code, interleave(x, y, z)) << x << ' ' << y << ' ' << z;
    uint32_t u, v, w;
    morton_decode(code, u, v, w);
    ASSERT_EQ(u, x);
    ASSERT_EQ(v, y);
    ASSERT_EQ(w, z);
  }
}

// The largest coordinates are encoded; bits above bit 20 are ignored.
TEST(Morton, HasTwentyOneBitsAnAxis) {
  EXPECT_EQ(morton_encode(0x1fffff, 0x1fffff, 0x1fffff), 0x7fffffffffffffffull);
  EXPECT_EQ(morton_encode(0x200000, 0, 0), 0u);
  EXPECT_EQ(gather_bits3(0x6db6db6db6db6db6ull), 0u);
}

}  // namespace
}  // namespace voxdag
