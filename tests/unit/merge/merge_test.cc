#include "merge/merge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/unit/merge/merge_harness.h"

namespace voxdag {
namespace {

// A merge of subvolumes of one size gives the bytes of the complete DAG, for any number of hash
// bits, any size of the subvolumes, and any number of threads.
TEST(Merge, EqualSubvolumesGiveTheDagOfTheWhole) {
  for (const uint32_t hash_bits : {4u, 16u, 64u})
    for (uint64_t seed = 0; seed < 3; ++seed) {
      SCOPED_TRACE("hash bits " + std::to_string(hash_bits) + ", seed " + std::to_string(seed));
      const oracle::Voxels voxels = mixed_voxels(seed, 64);
      for (const uint32_t level : {0u, 1u, 2u, 4u}) {
        SCOPED_TRACE("subvolumes of level " + std::to_string(level));
        MergeHarness harness(6, hash_bits);
        harness.add(voxels, equal_cubes(level));
        for (unsigned threads = 1; threads <= 3; ++threads)
          harness.expect_dag_of(voxels, harness.merge({.threads = threads}));
      }
    }
}

// A merge gives the complete DAG if subvolumes have different sizes. A level then has roots of some
// subvolumes, inner nodes of others, and nodes of the top tree.
TEST(Merge, SubvolumesOfDifferentSizesGiveTheDagOfTheWhole) {
  for (const uint32_t hash_bits : {4u, 16u, 64u})
    for (uint64_t seed = 10; seed < 16; ++seed) {
      SCOPED_TRACE("hash bits " + std::to_string(hash_bits) + ", seed " + std::to_string(seed));
      const oracle::Voxels voxels = mixed_voxels(seed, 64);
      MergeHarness harness(6, hash_bits);
      harness.add(voxels, mixed_cubes(seed, 4));
      harness.expect_dag_of(voxels, harness.merge());
    }
}

// The order of the artifacts does not affect the bytes.
TEST(Merge, AnyOrderOfArtifactsGivesTheSameBytes) {
  const oracle::Voxels voxels = mixed_voxels(20, 64);
  MergeHarness harness(6, 64);
  harness.add(voxels, mixed_cubes(20, 3));
  const std::string sha256 = harness.merge().file.sha256;
  for (uint64_t seed = 0; seed < 4; ++seed) {
    std::mt19937_64 random(seed);
    std::shuffle(harness.artifacts().begin(), harness.artifacts().end(), random);
    EXPECT_EQ(harness.merge().file.sha256, sha256);
  }
}

// A merge also gives the complete DAG in a grid of one brick, where this brick is the root.
TEST(Merge, TheSmallestGridIsOneBrick) {
  const oracle::Voxels voxels = mixed_voxels(21, 4);
  MergeHarness harness(2, 64);
  harness.add(voxels, {Cube{}});
  const Merged merged = harness.merge();
  harness.expect_dag_of(voxels, merged);
  EXPECT_EQ(merged.report.dag_nodes, 1u);
}

// Without artifacts, the merge writes a valid file without nodes.
TEST(Merge, NoArtifactsGiveAFileWithoutNodes) {
  MergeHarness harness(6, 64);
  std::filesystem::create_directory(harness.scratch_folder());
  const Merged merged = harness.merge();
  EXPECT_EQ(merged.report.dag_nodes, 0u);
  EXPECT_EQ(merged.file.sha256, harness.expected({}).sha256);
}

// The merge that Sintorn's tutorial "DAG Construction" (2018) published omitted the child mask from
// the hash. So two parents that had equal sub-DAGs in different octants became one node, and voxels
// moved. In this test, two such pairs of parents must remain different nodes, on two consecutive
// levels of the merge.
TEST(Merge, EqualSubDagsInDifferentOctantsKeepTheirPlaces) {
  oracle::Voxels voxels(32);
  const auto blob = [&](int x, int y, int z) {
    for (int i = 0; i < 4; ++i) voxels.set(x + i, y + i % 2, z);
  };
  // The brick of the blob is child 0 of one cube of 8 voxels per edge, and child 7 of another.
  // These two cubes are octants 0 and 5 of their cubes of 16 voxels per edge.
  blob(0, 0, 0);
  blob(16 + 8 + 4, 16 + 4, 16 + 8 + 4);
  for (const uint32_t hash_bits : {4u, 64u})
    for (const uint32_t level : {2u, 3u}) {
      SCOPED_TRACE("hash bits " + std::to_string(hash_bits) + ", level " + std::to_string(level));
      MergeHarness harness(5, hash_bits);
      harness.add(voxels, equal_cubes(level));
      const Merged merged = harness.merge();
      harness.expect_dag_of(voxels, merged);
      // One brick; two nodes each on levels 2 and 1; the root.
      EXPECT_EQ(merged.report.dag_nodes, 6u);
    }
}

// Progress ends at its total, with one pass and with several.
TEST(Merge, ProgressReachesItsTotal) {
  struct Counting : NoProgress {
    uint64_t total = 0;
    std::atomic<uint64_t> done{0};
    void begin_stage(std::string_view, uint64_t count, std::string_view) override { total = count; }
    void set_total(uint64_t count) override { total = count; }
    void advance(uint64_t count) override { done += count; }
  };
  const oracle::Voxels voxels = noise_voxels(23, 256);
  MergeHarness harness(8, 64);
  harness.add(voxels, equal_cubes(3));
  for (const uint64_t budget_bytes : {uint64_t{1} << 30, uint64_t{8} << 20}) {
    Counting progress;
    const Merged merged = harness.merge({.budget_bytes = budget_bytes, .progress = &progress});
    EXPECT_EQ(merged.report.passes > 1, budget_bytes < uint64_t{1} << 30);
    EXPECT_EQ(progress.done, progress.total);
    EXPECT_EQ(progress.done, merged.report.input_nodes);
  }
}

}  // namespace
}  // namespace voxdag
