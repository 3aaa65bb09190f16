#include "core/format/global/diff.h"

#include <gmock/gmock.h>

#include "core/format/global/open_global.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

class DiffTest : public testing::Test {
 protected:
  DiffReport diff() {
    const auto a = open_global_file(a_), b = open_global_file(b_);
    MemoryBudget budget(uint64_t{1} << 30);
    const CancelToken cancel;
    const DiffReport report = diff_global_files(*a, *b, 1, budget, cancel);
    const DiffReport same = diff_global_files(*a, *b, 3, budget, cancel);
    EXPECT_EQ(report.only_a, same.only_a);
    EXPECT_EQ(report.only_b, same.only_b);
    EXPECT_EQ(budget.used(), 0u);
    return report;
  }
  TemporaryFolder folder_;
  const std::string a_ = folder_.file("a.vdag"), b_ = folder_.file("b.vdag");
};

// The counts equal the counts of a comparison voxel by voxel, for any hash bits of the two files.
TEST_F(DiffTest, CountsTheVoxelsThatDiffer) {
  for (const int edge : {4, 8, 32})
    for (uint64_t seed = 0; seed < 8; ++seed) {
      SCOPED_TRACE("edge " + std::to_string(edge) + ", seed " + std::to_string(seed));
      const oracle::Voxels a = random_voxels(seed, edge), b = random_voxels(seed / 2, edge);
      write_global(a_, a, 64);
      write_global(b_, b, 4 + 7 * static_cast<uint32_t>(seed));
      uint64_t only_a = 0, only_b = 0;
      for (int x = 0; x < edge; ++x)
        for (int y = 0; y < edge; ++y)
          for (int z = 0; z < edge; ++z) {
            only_a += a.at(x, y, z) && !b.at(x, y, z);
            only_b += b.at(x, y, z) && !a.at(x, y, z);
          }
      const DiffReport report = diff();
      EXPECT_EQ(report.only_a, only_a);
      EXPECT_EQ(report.only_b, only_b);
      EXPECT_EQ(report.same(), a == b);
    }
}

// One additional voxel in the second file is counted, in a large scene with shared nodes.
TEST_F(DiffTest, FindsASingleVoxel) {
  oracle::Voxels voxels = random_voxels(1, 128);
  write_global(a_, voxels);
  int x = 0;
  while (voxels.at(x, 77, 31)) ++x;
  voxels.set(x, 77, 31);
  write_global(b_, voxels);
  EXPECT_EQ(diff().only_a, 0u);
  EXPECT_EQ(diff().only_b, 1u);
}

TEST_F(DiffTest, EmptyScenes) {
  const oracle::Voxels voxels = random_voxels(1, 16);
  write_global(a_, oracle::Voxels(16));
  write_global(b_, oracle::Voxels(16));
  EXPECT_TRUE(diff().same());
  write_global(b_, voxels);
  EXPECT_EQ(diff().only_a, 0u);
  EXPECT_EQ(diff().only_b, voxels.count());
}

// A solid cube of 2^20 voxels per edge has one node per level and 2^60 voxels. The walk visits
// pairs of nodes, so it is fast, and it counts in 64 bits.
TEST_F(DiffTest, CountsBeyond32BitsInAMoment) {
  const auto write_solid = [](const std::string& path, uint64_t brick) {
    Grid grid;
    grid.levels = 20;
    GlobalFileWriter writer(system_files(), path, grid, 64);
    const uint32_t words[2] = {static_cast<uint32_t>(brick), static_cast<uint32_t>(brick >> 32)};
    writer.begin_level(18);
    writer.checksum_words(words);
    writer.write_words(0, words);
    writer.end_level({1, 2});
    const uint32_t node[9] = {255};
    for (uint32_t level = 18; level-- > 0;) {
      writer.begin_level(level);
      writer.checksum_words(node);
      writer.write_words(0, node);
      writer.end_level({1, 9});
    }
    const uint64_t bricks = uint64_t{1} << 54;
    writer.finish({bricks * static_cast<uint64_t>(popcount64(brick)), (8 * bricks - 1) / 7});
  };
  write_solid(a_, ~uint64_t{0});
  write_solid(b_, 1);
  EXPECT_EQ(diff().only_a, uint64_t{63} << 54);
  EXPECT_EQ(diff().only_b, 0u);
}

TEST_F(DiffTest, OtherGridsAreRefused) {
  write_global(a_, random_voxels(1, 16));
  write_global(b_, random_voxels(1, 32));
  EXPECT_EQ(error_of([&] { diff(); }).code(), ErrorCode::kInvalidInput);
  Grid moved = grid_of(16);
  moved.origin[2] += 1;
  write_global(b_, oracle::build_dag(random_voxels(1, 16), 64), moved);
  const Error error = error_of([&] { diff(); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  EXPECT_THAT(error.message(), testing::HasSubstr("16 voxels, origin -1.5 0.25 4, edge 2.5"));
}

}  // namespace
}  // namespace voxdag
