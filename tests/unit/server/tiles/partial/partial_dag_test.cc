#include "server/tiles/partial/partial_dag.h"

#include <gtest/gtest.h>

#include <random>

#include "core/base/error.h"
#include "query/tiles/tile.h"

namespace voxdag::server {
namespace {

// True if the voxel is set in the DAG. Reads the words of the DAG without calling the tested code.
bool is_set(const PartialDag& dag, uint32_t levels, uint64_t root, uint32_t x, uint32_t y,
            uint32_t z) {
  uint64_t at = root;
  for (uint32_t level = 0; level + 2 < levels; ++level) {
    const std::vector<uint32_t>& words = dag.levels()[level];
    const uint32_t shift = levels - 1 - level;
    const uint32_t child = (x >> shift & 1) * 4 + (y >> shift & 1) * 2 + (z >> shift & 1);
    if (!(words[at] >> child & 1)) return false;
    const int before = __builtin_popcount(words[at] & ((1u << child) - 1));
    at = words[at + 1 + static_cast<uint64_t>(before)];
  }
  const uint32_t bit =
      (x & 2) * 16 + (y & 2) * 8 + (z & 2) * 4 + (x & 1) * 4 + (y & 1) * 2 + (z & 1);
  return dag.levels()[levels - 2][at + bit / 32] >> (bit % 32) & 1;
}

// True if the voxel is in an occupied cell of one of the parts.
bool has(const std::vector<PartialDag::Part>& parts, uint32_t levels, uint32_t x, uint32_t y,
         uint32_t z) {
  for (const auto& [cube, brick] : parts) {
    const uint32_t edge = 1u << (levels - cube.level);
    if (x / edge != cube.position[0] || y / edge != cube.position[1] ||
        z / edge != cube.position[2])
      continue;
    const uint32_t cx = x % edge * 4 / edge, cy = y % edge * 4 / edge, cz = z % edge * 4 / edge;
    return brick >> (cx / 2 * 32 + cy / 2 * 16 + cz / 2 * 8 + cx % 2 * 4 + cy % 2 * 2 + cz % 2) & 1;
  }
  return false;
}

// Adds parts with random cells for cubes of all sizes, down to the size of a brick. Omits some
// cubes, as if they were not built yet.
void add_random_parts(const Cube& cube, uint32_t levels, std::mt19937& random,
                      std::vector<PartialDag::Part>& parts) {
  if (cube.level + 2 < levels && random() % 3 != 0) {
    for (int i = 0; i < 8; ++i)
      if (random() % 4 != 0) add_random_parts(cube.child(i), levels, random, parts);
  } else {
    parts.push_back({cube, uint64_t{random()} << 32 | random()});
  }
}

TEST(PartialDag, HasTheCellsOfItsParts) {
  for (const uint32_t seed : {1u, 2u, 3u, 4u}) {
    std::mt19937 random(seed);
    const uint32_t levels = 5, edge = 32;
    std::vector<PartialDag::Part> parts;
    while (parts.size() < 20) {
      parts.clear();
      add_random_parts({}, levels, random, parts);
    }
    PartialDag dag(levels);
    std::shuffle(parts.begin(), parts.end(), random);
    // Adds some parts, then all parts. The first root must still contain only the first parts.
    std::vector<PartialDag::Part> first(parts.begin(), parts.begin() + 9);
    const auto old_root = dag.add(first), root = dag.add(parts);
    ASSERT_TRUE(old_root && root);
    EXPECT_NE(*old_root, *root);
    for (uint32_t i = 0; i < edge * edge * edge; ++i) {
      const uint32_t x = i / edge / edge, y = i / edge % edge, z = i % edge;
      ASSERT_EQ(is_set(dag, levels, *root, x, y, z), has(parts, levels, x, y, z)) << i;
      ASSERT_EQ(is_set(dag, levels, *old_root, x, y, z), has(first, levels, x, y, z)) << i;
    }
    const uint64_t words = dag.word_count();
    EXPECT_EQ(dag.add(parts), root) << "the same parts are the same node";
    EXPECT_EQ(dag.word_count(), words);
    const PartialDagCopy copy(dag, levels);
    EXPECT_NO_THROW(query::encode_tile(copy.view(), 3, {0, *root}));
    EXPECT_NO_THROW(query::encode_tile(copy.view(), 3, {0, *old_root}));
  }
}

TEST(PartialDag, SmallestAndLargestGrids) {
  PartialDag brick(2);
  EXPECT_EQ(brick.add({}), std::nullopt);
  EXPECT_TRUE(PartialDagCopy(brick, 2).view().empty());
  EXPECT_EQ(brick.add({{{}, 0}}), std::nullopt);
  EXPECT_EQ(brick.add({{{}, 0x8000000000000001}}), 0u);
  EXPECT_EQ(brick.levels()[0], (std::vector<uint32_t>{1, 0x80000000}));
  PartialDag large(20);
  EXPECT_EQ(large.add({{{8, {255, 0, 255}}, ~uint64_t{0}}}), 0u);
  EXPECT_TRUE(is_set(large, 20, 0, (1u << 20) - 1, 4095, (1u << 20) - 4096));
  EXPECT_FALSE(is_set(large, 20, 0, (1u << 20) - 1, 4096, (1u << 20) - 4096));
  EXPECT_LT(large.word_count(), 300u) << "what is solid costs a node per level";
}

TEST(PartialDag, RefusesPartsThatOverlap) {
  PartialDag dag(6);
  for (const std::vector<PartialDag::Part>& parts :
       std::vector<std::vector<PartialDag::Part>>{{{{1, {0, 0, 0}}, 1}, {{2, {1, 0, 0}}, 1}},
                                                  {{{2, {1, 0, 0}}, 1}, {{2, {1, 0, 0}}, 1}},
                                                  {{{4, {0, 0, 0}}, 1}, {{4, {0, 0, 0}}, 2}},
                                                  {{{1, {2, 0, 0}}, 1}},
                                                  {{{5, {0, 0, 0}}, 1}}})
    EXPECT_THROW(dag.add(parts), Error);
}

}  // namespace
}  // namespace voxdag::server
