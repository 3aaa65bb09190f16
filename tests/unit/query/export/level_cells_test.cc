// Tests LevelCells, which counts the cells of each level. Exports use it to find a level that fits
// their format.
#include "query/export/level_cells.h"

#include "core/format/global/open_global.h"
#include "query/lookup/bricks.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kCellLevels = 6;
constexpr uint64_t kNoLimit = ~uint64_t{0};

class LevelCellsTest : public testing::TestWithParam<uint64_t> {
 protected:
  // Writes a file with random voxels. Pointers to a level of more than GetParam() words have 64
  // bits.
  void write(uint64_t seed) {
    const oracle::Voxels voxels = random_voxels(seed, 1 << kCellLevels);
    write_global(path_, oracle::build_dag(voxels, 64), grid_of(1 << kCellLevels), 64, GetParam());
  }
  uint64_t cells(const DagView& dag, uint32_t grid_levels) const {
    uint64_t cells = 0;
    for_each_brick(dag, {grid_levels, whole_grid(grid_levels)}, [&](const Brick& brick) {
      cells += static_cast<uint64_t>(std::popcount(brick.mask));
    });
    return cells;
  }
  TemporaryFolder folder_;
  const std::string path_ = folder_.file("a.vdag");
  MemoryBudget budget_{1 << 20};
  CancelToken cancel_;
};

TEST_P(LevelCellsTest, AreThoseOfTheOctree) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    write(seed);
    const auto file = open_global_file(path_);
    const DagView dag(*file);
    LevelCells counts(*file, dag, budget_, cancel_);
    for (uint32_t level = 2; level < kCellLevels; ++level)
      EXPECT_EQ(counts.count(level, kNoLimit), cells(dag, level)) << level;
    EXPECT_EQ(LevelCells(*file, dag, budget_, cancel_).count(kCellLevels - 1, kNoLimit),
              cells(dag, kCellLevels - 1));
  }
  EXPECT_EQ(budget_.used(), 0u);
}

TEST_P(LevelCellsTest, NeedMemory) {
  write(1);
  const auto file = open_global_file(path_);
  const DagView dag(*file);
  MemoryBudget little(100);
  LevelCells counts(*file, dag, little, cancel_);
  EXPECT_EQ(error_of([&] { counts.count(kCellLevels - 1, kNoLimit); }).code(),
            ErrorCode::kOutOfMemory);
}

TEST_P(LevelCellsTest, PointersToNoNodeAreDamage) {
  write(1);
  ByteString bytes = read_bytes(path_);
  const uint64_t root = open_global_file(path_)->level(0).file_offset;
  ++bytes[root + 4];  // the root's first pointer now leads into the middle of a node
  write_bytes(path_, bytes);
  const auto file = open_global_file(path_);
  const DagView dag(*file);
  EXPECT_EQ(error_of([&] { LevelCells(*file, dag, budget_, cancel_).count(3, kNoLimit); }).code(),
            ErrorCode::kCorrupt);
}

INSTANTIATE_TEST_SUITE_P(Pointers, LevelCellsTest, testing::Values(uint64_t{1} << 32, uint64_t{50}),
                         [](const auto& pointers) {
                           return pointers.param == 50 ? "Wide" : "Narrow";
                         });

}  // namespace
}  // namespace voxdag::query
