// The values that `verify` computes for nodes, on all versions of the code that this CPU can run.
#include "core/format/verify/node_batch.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/format/global/open_global.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

std::vector<ComputeBatch> versions() {
  std::vector<ComputeBatch> all = {compute_batch_portable};
  if (compute_batch_popcnt()) all.push_back(compute_batch_popcnt());
  return all;
}

// Returns the values of a cube with 2^`levels` voxels per edge in which every voxel is set.
Subtree full_cube(uint32_t levels, uint64_t hash) {
  Subtree cube{hash, 1, 0};
  for (uint32_t level = 0; level < levels; ++level) {
    cube.voxels *= 8;
    if (level > 0) cube.svo_nodes = 8 * cube.svo_nodes + 1;
  }
  return cube;
}

class SubtreeTableTest : public testing::TestWithParam<uint32_t> {
 protected:
  static constexpr uint64_t kChildren = 8;

  MemoryBudget budget_{uint64_t{1} << 20};
  SubtreeTable table_{budget_, kChildren, GetParam()};
};

TEST_P(SubtreeTableTest, KeepsTheValuesOfFullCubes) {
  const Subtree cube = full_cube(GetParam(), 0xfedcba9876543210);
  table_.set(3, cube);
  EXPECT_EQ(table_.at(3).hash, cube.hash);
  EXPECT_EQ(table_.at(3).voxels, cube.voxels);
  EXPECT_EQ(table_.at(3).svo_nodes, cube.svo_nodes);
  EXPECT_FALSE(table_.has_parent(3));
  EXPECT_EQ(table_.hash(2), 0u);
  EXPECT_EQ(table_.hash(4), 0u);
}

// A node with eight full children is a full cube. Its hash is the hash of docs/format.md.
// Afterwards, exactly the children to which the nodes refer are marked as having a parent. The
// other values of the children are unchanged.
TEST_P(SubtreeTableTest, ParentsHaveTheSumsOfTheirChildren) {
  const std::vector<uint32_t> words = {255, 0, 2, 4, 6, 8, 10, 12, 14, 129, 0, 14};
  voxdag_reader::Level nodes;
  nodes.words = words.data();
  nodes.word_count = words.size();
  for (const ComputeBatch compute : versions()) {
    std::vector<uint64_t> hashes;
    for (uint64_t i = 0; i < kChildren; ++i) {
      hashes.push_back(oracle::brick_hash(i));
      table_.set(i, full_cube(GetParam(), hashes.back()));
    }
    const NodeLevel level{nodes, 40, false, {nullptr, 2 * kChildren}, table_.words()};
    NodeBatch batch;
    batch.count = 1;
    batch.at[0] = 9;
    compute(level, batch);
    for (uint64_t i = 0; i < kChildren; ++i)
      EXPECT_EQ(table_.has_parent(i), i == 0 || i + 1 == kChildren) << i;
    EXPECT_EQ(batch.subtrees[0].voxels, 2 * full_cube(GetParam(), 0).voxels);

    batch.at[0] = 0;
    compute(level, batch);
    ASSERT_EQ(batch.valid, 1u);
    const Subtree cube = full_cube(GetParam() + 1, 0);
    EXPECT_EQ(batch.subtrees[0].hash, oracle::truncated(oracle::node_hash(255, hashes), 40));
    EXPECT_EQ(batch.subtrees[0].voxels, cube.voxels);
    EXPECT_EQ(batch.subtrees[0].svo_nodes, cube.svo_nodes);
    for (uint64_t i = 0; i < kChildren; ++i) {
      EXPECT_TRUE(table_.has_parent(i)) << i;
      EXPECT_EQ(table_.hash(i), hashes[i]);
    }
  }
}

// The cubes are between a brick and a child of the largest possible root. The values include the
// limits of both layouts of subtree_table.h.
INSTANTIATE_TEST_SUITE_P(CubeLevels, SubtreeTableTest, testing::Values(2, 4, 5, 6, 19));

// A pointer leads to no node if its offset is odd or beyond the end of the level. Only the nodes
// before the first node with such a pointer have results.
TEST(NodeBatchTest, NamesTheFirstPointerToNoNode) {
  for (const ComputeBatch compute : versions())
    for (const uint32_t broken : {1u, 8u, 0xffffffffu}) {
      const std::vector<uint32_t> words = {3, 0, 2, 7, 4, 6, broken, 1, broken};
      voxdag_reader::Level nodes;
      nodes.words = words.data();
      nodes.word_count = words.size();
      MemoryBudget budget(uint64_t{1} << 20);
      SubtreeTable table(budget, 4, 2);
      for (uint64_t i = 0; i < 4; ++i) table.set(i, full_cube(2, i));
      NodeBatch batch;
      batch.count = 3;
      batch.at[0] = 0, batch.at[1] = 3, batch.at[2] = 7;
      compute({nodes, 64, false, {nullptr, 8}, table.words()}, batch);
      EXPECT_EQ(batch.valid, 1u);
      EXPECT_EQ(batch.broken_child, 2);
      EXPECT_EQ(batch.subtrees[0].voxels, 128u);
    }
}

}  // namespace
}  // namespace voxdag
