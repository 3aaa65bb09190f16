// Compares the DAG constructions by pointers and by hashes, and tests the verification sweep that
// makes the construction by hashes exact.
#include <gtest/gtest.h>

#include "core/backend/parallel/dag/dag_by_hashes.h"
#include "core/backend/parallel/dag/dag_by_pointers.h"
#include "core/backend/parallel/dag/host_levels.h"
#include "core/backend/parallel/dag/octree.h"
#include "core/backend/parallel/space/host_space.h"
#include "core/dag/brick.h"
#include "tests/oracle/check_sub_dag.h"
#include "tests/oracle/scenes.h"

namespace voxdag::parallel {
namespace {

class ParallelDag : public testing::Test {
 protected:
  // Returns a random octree with `levels` levels above the bricks. The bricks have at most
  // `different_bricks` different masks.
  Octree<HostSpace> random_octree(uint64_t seed, uint32_t levels, int64_t different_bricks) {
    oracle::Random random(seed);
    const uint32_t max_count = 1u << 3 * levels;
    BrickList<HostSpace> bricks(space, static_cast<int>(3 * levels));
    const uint32_t at = bricks.reserve(max_count);
    uint32_t count = 0;
    for (uint32_t code = 0; code < max_count; ++code) {
      if (random.between(0, 3) == 0 && !(code + 1 == max_count && count == 0)) continue;
      bricks.codes()[at + count] = code;
      bricks.masks()[at + count++] =
          static_cast<uint64_t>(random.between(1, different_bricks)) * 0x9e3779b97f4a7c15ull;
    }
    bricks.commit(count, true);
    return make_octree(space, bricks, levels);
  }
  SubDag as_sub_dag(SpaceDag<HostSpace>&& dag, uint32_t levels) {
    SubDag out;
    HostLevels<HostSpace>(space, std::move(dag)).send(levels, out);
    return out;
  }

  MemoryBudget budget{uint64_t{1} << 28};
  CancelToken cancel;
  HostSpace space{budget, cancel, 2};
};

TEST_F(ParallelDag, BothConstructionsAgreeAndAreInOrder) {
  for (const uint32_t levels : {0u, 1u, 2u, 4u, 5u})
    for (const int64_t different : {1, 2, 40, 100000}) {
      SCOPED_TRACE(testing::Message() << levels << " levels, " << different << " bricks");
      const auto tree = random_octree(levels, levels, different);
      auto by_hashes = make_dag_by_hashes(space, tree, 64);
      ASSERT_TRUE(by_hashes.has_value());
      auto by_pointers = make_dag_by_pointers(space, tree, 64);
      EXPECT_EQ(by_hashes->root_hash, by_pointers.root_hash);
      EXPECT_EQ(by_hashes->node_count(), by_pointers.node_count());
      const SubDag a = as_sub_dag(std::move(*by_hashes), levels);
      EXPECT_TRUE(a == as_sub_dag(std::move(by_pointers), levels));
      EXPECT_NO_THROW(check_sub_dag(a, {.grid_levels = levels + kBrickLevels}));
    }
}

// The hashes have only 6 to 13 bits, so some octrees have different nodes with equal hashes. Then
// the verification sweep must find the collision, and make_dag_by_hashes() must return nullopt.
// Every DAG that it returns must be right.
TEST_F(ParallelDag, TheSweepRejectsCollisions) {
  int accepted = 0, rejected = 0;
  for (uint64_t seed = 0; seed < 600; ++seed) {
    const uint32_t hash_bits = 6 + static_cast<uint32_t>(seed % 8);
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", hash bits " << hash_bits);
    const auto tree = random_octree(seed, 2, 1 + static_cast<int64_t>(seed % 5));
    auto by_hashes = make_dag_by_hashes(space, tree, hash_bits);
    auto by_pointers = make_dag_by_pointers(space, tree, hash_bits);
    const uint64_t nodes = by_pointers.node_count();
    const SubDag truth = as_sub_dag(std::move(by_pointers), 2);
    ASSERT_NO_THROW(check_sub_dag(truth, {.grid_levels = 4, .hash_bits = hash_bits}));
    if (!by_hashes) {
      ++rejected;
      continue;
    }
    ++accepted;
    EXPECT_EQ(by_hashes->node_count(), nodes);
    ASSERT_TRUE(as_sub_dag(std::move(*by_hashes), 2) == truth);
  }
  EXPECT_GT(accepted, 50);
  EXPECT_GT(rejected, 50);
}

// Two different bricks have equal 4-bit hashes. Their parents differ only in these bricks, so the
// parents' hashes are also equal. make_dag_by_hashes() keeps only one parent, so it never compares
// the other parent's brick. Only the sweep over all octree nodes detects that the bricks differ.
TEST_F(ParallelDag, TheSweepLooksAtDroppedNodes) {
  uint64_t one = 1, other = 2;
  while (truncate_hash(hash_brick(other), 4) != truncate_hash(hash_brick(one), 4)) ++other;
  BrickList<HostSpace> bricks(space, 6);
  bricks.reserve(2);
  const uint64_t codes[2] = {0 * 8 + 3, 5 * 8 + 3};
  for (int i = 0; i < 2; ++i) bricks.codes()[i] = codes[i];
  bricks.masks()[0] = one;
  bricks.masks()[1] = other;
  bricks.commit(2, true);
  const auto tree = make_octree(space, bricks, 2);
  EXPECT_FALSE(make_dag_by_hashes(space, tree, 4).has_value());
  EXPECT_EQ(make_dag_by_pointers(space, tree, 4).node_count(), 5u);
}

}  // namespace
}  // namespace voxdag::parallel
