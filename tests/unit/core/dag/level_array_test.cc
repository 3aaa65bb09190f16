#include "core/dag/level_array.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace voxdag {
namespace {

struct Node {
  uint64_t hash;
  uint32_t mask;
  std::vector<uint32_t> children;
};

int compare(const Node& a, const Node& b) {
  return compare_nodes(a.hash, a.mask, a.children.data(), b.hash, b.mask, b.children.data());
}

// The order compares hashes, then masks, then children from the first to the last, all as unsigned
// numbers.
TEST(TotalOrder, ComparesHashMaskChildren) {
  const std::vector<Node> sorted = {{0, 0x80, {9}},
                                    {1, 0x01, {7}},
                                    {1, 0x01, {8}},
                                    {1, 0x03, {0, 5}},
                                    {1, 0x03, {0, 6}},
                                    {1, 0x03, {1, 0}},
                                    {1, 0x03, {0x80000000, 0}},
                                    {1, 0xff, {0, 0, 0, 0, 0, 0, 0, 1}},
                                    {1, 0xff, {0, 0, 0, 0, 0, 0, 0, 2}},
                                    {~uint64_t{0}, 0x01, {0}}};
  for (size_t i = 0; i < sorted.size(); ++i)
    for (size_t j = 0; j < sorted.size(); ++j) {
      const int sign = compare(sorted[i], sorted[j]);
      EXPECT_EQ(sign < 0, i < j) << i << ' ' << j;
      EXPECT_EQ(sign == 0, i == j) << i << ' ' << j;
    }
}

// Children beyond the number of bits in the mask are ignored.
TEST(TotalOrder, StopsAtTheLastChild) {
  EXPECT_EQ(compare({5, 0x11, {1, 2, 3}}, {5, 0x11, {1, 2, 4}}), 0);
  const uint32_t a[] = {1, 2}, b[] = {1, 3};
  EXPECT_EQ(compare_children(a, b, 1), 0);
  EXPECT_LT(compare_children(a, b, 2), 0);
  EXPECT_EQ(compare_children(a, b, 0), 0);
}

// Replacing child indices through a strictly increasing map preserves the order; the merge relies
// on that.
TEST(TotalOrder, SurvivesIncreasingMaps) {
  std::mt19937_64 random(9);
  std::vector<uint32_t> map(20);
  for (size_t i = 0; i < map.size(); ++i)
    map[i] = (i ? map[i - 1] + 1 : 0) + static_cast<uint32_t>(random() % 1000);
  const auto node = [&] {
    Node n{random() % 2, static_cast<uint32_t>(1 + random() % 3), {}};
    for (int c = 0; c < popcount64(n.mask); ++c)
      n.children.push_back(static_cast<uint32_t>(random() % map.size()));
    return n;
  };
  for (int i = 0; i < 5000; ++i) {
    Node a = node(), b = node();
    const int before = compare(a, b);
    for (Node* n : {&a, &b})
      for (uint32_t& child : n->children) child = map[child];
    const int after = compare(a, b);
    ASSERT_EQ(before < 0, after < 0);
    ASSERT_EQ(before == 0, after == 0);
  }
}

}  // namespace
}  // namespace voxdag
