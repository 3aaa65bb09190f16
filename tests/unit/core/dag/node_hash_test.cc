#include "core/dag/node_hash.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <vector>

#include "tests/oracle/dag.h"

namespace voxdag {
namespace {

// The vectors were computed independently, with Python's integers. A changed constant needs a new
// format version.
TEST(NodeHash, VectorsOfVersionOne) {
  EXPECT_EQ(hash_brick(1), 0xda4ddbf519386855u);
  EXPECT_EQ(hash_brick(uint64_t{1} << 63), 0xfc87d407a2e26353u);
  EXPECT_EQ(hash_brick(~uint64_t{0}), 0xf75c5ae46c4df27cu);
  EXPECT_EQ(hash_brick(0x0123456789abcdef), 0xb8264d7267615257u);
  const uint64_t a = hash_brick(1), b = hash_brick(~uint64_t{0});
  const uint64_t ab[] = {a, b}, ba[] = {b, a}, aaaaaaaa[] = {a, a, a, a, a, a, a, a};
  EXPECT_EQ(hash_node(0x01, ab), 0x12775cd1c1e42156u);
  EXPECT_EQ(hash_node(0x80, ab), 0x016b06cb30ea7ca6u);
  EXPECT_EQ(hash_node(0x81, ab), 0x24d9bd25d0cd0db6u);
  EXPECT_EQ(hash_node(0x81, ba), 0x3c1535d3d8aa8ec4u);
  EXPECT_EQ(hash_node(0xff, aaaaaaaa), 0x02995b2011a1e04au);
}

// The oracle's own implementation of the definition agrees on random input. So do the incremental
// hash and the hash in one call.
TEST(NodeHash, EqualsTheOracle) {
  std::mt19937_64 random(4);
  for (int i = 0; i < 20000; ++i) {
    const uint64_t mask = random();
    ASSERT_EQ(hash_brick(mask), oracle::brick_hash(mask));
    const uint32_t child_mask = 1 + static_cast<uint32_t>(random() % 255);
    std::vector<uint64_t> children(static_cast<size_t>(popcount64(child_mask)));
    uint64_t running = node_hash_begin(child_mask);
    for (uint64_t& child : children) running = node_hash_add(running, child = random());
    ASSERT_EQ(hash_node(child_mask, children.data()), oracle::node_hash(child_mask, children));
    ASSERT_EQ(node_hash_end(running), hash_node(child_mask, children.data()));
    const int bits = 4 + static_cast<int>(random() % 61);
    ASSERT_EQ(truncate_hash(mask, static_cast<uint32_t>(bits)), oracle::truncated(mask, bits));
  }
}

// The same children with another mask are another node, so the hash must depend on the mask.
TEST(NodeHash, SeesTheMask) {
  const uint64_t children[8] = {1, 2, 3, 4, 5, 6, 7, 8};
  std::set<uint64_t> seen;
  for (uint32_t mask = 1; mask < 256; ++mask) seen.insert(hash_node(mask, children));
  EXPECT_EQ(seen.size(), 255u);
}

// Truncation preserves the top bits and clears the others.
TEST(NodeHash, IsCutFromBelow) {
  EXPECT_EQ(truncate_hash(~uint64_t{0}, 64), ~uint64_t{0});
  EXPECT_EQ(truncate_hash(~uint64_t{0}, 63), ~uint64_t{1});
  EXPECT_EQ(truncate_hash(~uint64_t{0}, 16), 0xffff000000000000u);
  EXPECT_EQ(truncate_hash(~uint64_t{0}, 4), 0xf000000000000000u);
}

}  // namespace
}  // namespace voxdag
