// Tests wide levels (levels to which pointers have 64 bits) on small scenes. For any memory and
// number of threads, the merge writes the file of the oracle's DAG. This file passes `verify`, and
// has the same voxels as the file with 32-bit pointers.
#include <gtest/gtest.h>

#include "core/format/global/diff.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "tests/unit/merge/merge_harness.h"

namespace voxdag {
namespace {

// The parameter is the number of words above which a level is wide. With the smaller value, all
// levels except the highest ones are wide. With the larger value, only the level of the bricks is
// wide.
class WideLevels : public testing::TestWithParam<uint64_t> {
 protected:
  // Checks that the merged file passes `verify`, has wide levels, and has the voxels of `narrow`.
  void check_file(MergeHarness& harness, const std::string& narrow) {
    const auto file = open_global_file(harness.merged_file());
    EXPECT_EQ(file->version(), 2u);
    EXPECT_EQ(file->level(file->brick_level()).pointer_bits, 64u);
    EXPECT_EQ(file->level(0).pointer_bits, 32u);
    for (uint32_t l = 0; l <= file->brick_level(); ++l)
      EXPECT_EQ(file->level(l).pointer_bits, file->level(l).word_count > GetParam() ? 64u : 32u);
    MemoryBudget budget(uint64_t{1} << 30);
    NoProgress silent;
    const CancelToken never;
    verify_global_file(*file, 3, budget, silent, never, GetParam());
    const auto other = open_global_file(narrow);
    EXPECT_EQ(other->version(), 1u);
    const DiffReport difference = diff_global_files(*file, *other, 3, budget, never);
    EXPECT_EQ(difference.only_a + difference.only_b, 0u);
  }

  // Merges the voxels, divided into cubes, with each of these memory budgets in units of 1/2
  // MiB.
  void merge(const oracle::Voxels& voxels, const std::vector<Cube>& cubes, uint32_t hash_bits,
             const std::vector<uint64_t>& half_mib) {
    MergeHarness wide(8, hash_bits, GetParam()), narrow(8, hash_bits);
    wide.add(voxels, cubes);
    narrow.add(voxels, cubes);
    narrow.merge();
    const Merged large = wide.merge();
    wide.expect_dag_of(voxels, large);
    check_file(wide, narrow.merged_file());
    for (const uint64_t budget : half_mib)
      for (const unsigned threads : {1u, 3u}) {
        SCOPED_TRACE(std::to_string(budget) + "/2 MiB, threads " + std::to_string(threads));
        const Merged small = wide.merge({.budget_bytes = budget * kMiB / 2, .threads = threads});
        EXPECT_EQ(small.file.sha256, large.file.sha256);
        EXPECT_GT(small.report.scratch_bytes, 0u);
      }
  }
};

TEST_P(WideLevels, HashPartitionsAndSpilledMaps) {
  merge(noise_voxels(1, 256), equal_cubes(1), 64, {15, 18});
}

TEST_P(WideLevels, SeveralPasses) { merge(noise_voxels(2, 256), equal_cubes(3), 64, {24, 16}); }

// With 4 hash bits, many rows have equal hashes. The heap merge (heap_merge.h) merges these rows.
TEST_P(WideLevels, EqualHashes) { merge(noise_voxels(3, 256), equal_cubes(3), 4, {24, 16}); }

// The merge has only one run. Its position map does not fit in the memory of a worker.
TEST_P(WideLevels, WindowsOfAMap) { merge(noise_voxels(4, 256), {Cube{}}, 64, {9}); }

INSTANTIATE_TEST_SUITE_P(NarrowWords, WideLevels, testing::Values(64, 500'000),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace voxdag
