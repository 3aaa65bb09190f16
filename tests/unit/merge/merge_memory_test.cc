// The merge under small budgets gives the same bytes with several hash partitions, several passes,
// spilled position maps and streamed groups (MergeReport::streamed_groups). The report must show
// that each of these happened.
#include "merge/plan/merge_memory.h"

#include <gtest/gtest.h>

#include "core/dag/node_hash.h"
#include "tests/unit/merge/merge_harness.h"

namespace voxdag {
namespace {

// Hash partitions and spilled position maps do not change the bytes of the file.
TEST(MergeMemory, HashPartitionsGiveTheSameBytes) {
  const oracle::Voxels voxels = noise_voxels(1, 256);
  for (const uint32_t hash_bits : {16u, 64u}) {
    SCOPED_TRACE("hash bits " + std::to_string(hash_bits));
    MergeHarness harness(8, hash_bits);
    harness.add(voxels, equal_cubes(1));
    const Merged large = harness.merge();
    harness.expect_dag_of(voxels, large);
    EXPECT_EQ(large.report.passes, 1u);
    EXPECT_EQ(large.report.hash_partitions, 7u);  // one per level
    EXPECT_EQ(large.report.scratch_bytes, 0u);
    for (unsigned threads = 1; threads <= 3; ++threads) {
      const Merged small = harness.merge({.budget_bytes = 5 * kMiB, .threads = threads});
      EXPECT_EQ(small.file.sha256, large.file.sha256);
      EXPECT_EQ(small.report.passes, 1u);
      EXPECT_GT(small.report.hash_partitions, 7u);
      EXPECT_GT(small.report.scratch_bytes, 0u);
    }
  }
}

// With enough memory for whole levels, partitions have the useful size.
TEST(MergeMemory, PartitionsHaveTheUsefulSize) {
  const oracle::Voxels voxels = noise_voxels(4, 256);
  for (const uint32_t hash_bits : {6u, 64u}) {
    SCOPED_TRACE("hash bits " + std::to_string(hash_bits));
    MergeHarness harness(8, hash_bits);
    harness.add(voxels, equal_cubes(1));
    const Merged whole = harness.merge();
    EXPECT_EQ(whole.report.hash_partitions, 7u);  // one per level
    const Merged useful = harness.merge({.useful_partition_bytes = 1});
    EXPECT_EQ(useful.file.sha256, whole.file.sha256);
    // Each of the eight runs has 32768 bricks in eight frames, and its nodes are in one frame per
    // level. So only the bricks have several partitions, and about three.
    EXPECT_GE(useful.report.hash_partitions, 8u);
    EXPECT_LE(useful.report.hash_partitions, 10u);
    EXPECT_EQ(useful.report.passes, 1u);
    EXPECT_EQ(useful.report.streamed_groups, 0u);
    EXPECT_EQ(useful.report.scratch_bytes, 0u);
    // A partition is never larger than its memory.
    const Merged small = harness.merge({.budget_bytes = 5 * kMiB, .useful_partition_bytes = 1});
    EXPECT_EQ(small.file.sha256, whole.file.sha256);
    EXPECT_GE(small.report.hash_partitions, useful.report.hash_partitions);
  }
}

// A group of equal hashes that is larger than the useful size is merged in memory if it fits.
TEST(MergeMemory, AGroupOfEqualHashesLargerThanTheUsefulSize) {
  const oracle::Voxels voxels = noise_voxels(5, 256);
  MergeHarness harness(8, 4);
  harness.add(voxels, {Cube{}});
  const Merged whole = harness.merge();
  const Merged useful = harness.merge({.useful_partition_bytes = 1});
  EXPECT_EQ(useful.file.sha256, whole.file.sha256);
  // 16 groups of bricks have five or six of the 64 frames each, and a partition of useful size has
  // less than five. So the bricks are one partition, although their groups could be streamed.
  EXPECT_LT(useful.report.hash_partitions, 16u);
  EXPECT_EQ(useful.report.streamed_groups, 0u);
}

// The useful size grows with the number of frames and of runs.
TEST(MergeMemory, UsefulSizeOfALevel) {
  const auto bytes_of = [](uint64_t frames) {
    return HashPartition::bytes_for({frames * kFrameRows, 4 * frames * kFrameRows}, 0);
  };
  MergeMemory plan;
  plan.useful_partition_bytes = kMiB;
  LevelRows rows;
  rows.add({});
  EXPECT_EQ(rows.useful_bytes(plan, 0), kMiB);
  for (int run = 0; run < 100; ++run) rows.add({10 * kFrameRows, 40 * kFrameRows});
  // 250 of the 1000 frames may be decoded twice, so there are at most three partitions. Each has a
  // third of the frames, and one more frame of each run.
  EXPECT_EQ(rows.useful_bytes(plan, 0), bytes_of(1000) / 3 + bytes_of(100) + 100);
  EXPECT_GT(rows.useful_bytes(plan, 2), rows.useful_bytes(plan, 0));
  EXPECT_NEAR(static_cast<double>(rows.useful_rows(plan).rows),
              (1000.0 / 3 + 100) * kFrameRows * 33 / 32, 100);
  plan.useful_partition_bytes = bytes_of(2000);
  EXPECT_EQ(rows.useful_bytes(plan, 0), bytes_of(2000));
  EXPECT_EQ(rows.useful_rows(plan).rows, rows.total().rows);

  // If most runs have only one frame, every partition would decode most of the frames.
  plan.useful_partition_bytes = kMiB;
  LevelRows skewed;
  for (int run = 0; run < 1000; ++run) skewed.add({kFrameRows, 4 * kFrameRows});
  skewed.add({300 * kFrameRows, 1200 * kFrameRows});
  EXPECT_GE(skewed.useful_bytes(plan, 0), bytes_of(1300));
}

// Too many artifacts for one pass are merged in several passes.
TEST(MergeMemory, PassesGiveTheSameBytes) {
  const oracle::Voxels voxels = noise_voxels(2, 256);
  for (const uint32_t hash_bits : {4u, 64u}) {
    SCOPED_TRACE("hash bits " + std::to_string(hash_bits));
    MergeHarness harness(8, hash_bits);
    harness.add(voxels, equal_cubes(3));
    const Merged at_once = harness.merge();
    harness.expect_dag_of(voxels, at_once);
    EXPECT_EQ(at_once.report.passes, 1u);
    for (const auto& [half_mib, passes] : {std::pair{24, 2u}, {16, 3u}, {11, 4u}}) {
      SCOPED_TRACE(std::to_string(half_mib) + "/2 MiB");
      const Merged merged = harness.merge({.budget_bytes = half_mib * kMiB / 2});
      EXPECT_EQ(merged.file.sha256, at_once.file.sha256);
      EXPECT_EQ(merged.report.passes, passes);
      EXPECT_GT(merged.report.scratch_bytes, 0u);
      EXPECT_GT(merged.report.input_nodes, at_once.report.input_nodes);
    }
  }
}

// If the position map of a run exceeds the memory for maps, the run is rewired in several steps.
// Each step loads a window (a range) of the map.
TEST(MergeMemory, WindowsOfAMapGiveTheSameBytes) {
  const oracle::Voxels voxels = noise_voxels(3, 256);
  MergeHarness harness(8, 64);
  // There is one run, whose brick map takes 1 MiB. In a budget of 4 MiB, the maps of a level get
  // 2/3 MiB, and the worker's window gets 1 MiB minus a frame. So the map does not fit.
  harness.add(voxels, {Cube{}});
  const Merged merged = harness.merge({.budget_bytes = 4 * kMiB, .threads = 1});
  harness.expect_dag_of(voxels, merged);
  EXPECT_GE(merged.report.scratch_bytes, kMiB);
}

// All bricks of the scene have hashes that begin with the same four bits. With 4 hash bits they are
// one group of equal hashes, which exceeds the merge's memory. The merge streams this group.
TEST(MergeMemory, AGroupOfEqualHashesLargerThanTheBudget) {
  constexpr uint64_t kBudgetBytes = 9 * kMiB / 2;
  const uint32_t hash_bits = 4;
  oracle::Voxels voxels(512);
  std::mt19937_64 random(4);
  uint64_t bricks = 0;
  for (int x = 0; x < 512; x += 4)
    for (int y = 0; y < 512; y += 4)
      for (int z = 0; z < 160; z += 4) {
        uint64_t mask = random();
        while (oracle::truncated(oracle::brick_hash(mask), hash_bits) != uint64_t{11} << 60)
          mask = random();
        for (int bit = 0; bit < 64; ++bit)
          if (mask >> bit & 1)
            voxels.set(x + (bit >> 4 & 2) + (bit >> 2 & 1), y + (bit >> 3 & 2) + (bit >> 1 & 1),
                       z + (bit >> 2 & 2) + (bit & 1));
        ++bricks;
      }
  ASSERT_GT(bricks * sizeof(uint64_t), kBudgetBytes);
  MergeHarness harness(9, hash_bits);
  harness.add(voxels, equal_cubes(1));
  const Merged merged = harness.merge({.budget_bytes = kBudgetBytes});
  harness.expect_dag_of(voxels, merged);
  EXPECT_GT(merged.report.streamed_groups, 0u);
}

// The merge divides rows by their hashes into buckets and sorts each. With few distinct hashes,
// some buckets are too large to be sorted, and are merged row by row. The file is the same.
TEST(MergeMemory, BucketsOfFewHashesGiveTheSameBytes) {
  const oracle::Voxels voxels = noise_voxels(5, 128);
  MergeHarness harness(7, 4);
  harness.add(voxels, mixed_cubes(5, 2));
  for (const uint64_t mib : {6, 12, 100}) {
    SCOPED_TRACE(std::to_string(mib) + " MiB");
    harness.expect_dag_of(voxels, harness.merge({.budget_bytes = mib * kMiB, .threads = 3}));
  }
}

// A budget that cannot hold two frames of each of two runs is refused.
TEST(MergeMemory, TooSmallABudgetIsAnError) {
  MergeHarness harness(6, 64);
  harness.add(noise_voxels(6, 64), equal_cubes(1));
  try {
    harness.merge({.budget_bytes = 100000});
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory) << error.message();
  }
}

}  // namespace
}  // namespace voxdag
