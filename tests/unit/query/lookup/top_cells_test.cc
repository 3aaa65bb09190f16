// Lookups of many points start at TopCells, a table of the nodes of a coarse grid, instead of the
// root. They find exactly the cells that are set.
#include "query/lookup/top_cells.h"

#include <gtest/gtest.h>

#include <array>

#include "tests/unit/query/query_files.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

constexpr size_t kManyPoints = 20'000;

// Returns set cells, their neighbors, random cells, and points outside the grid.
std::vector<Position> points_of(const QueryFile::Cells& cells, uint32_t grid_levels) {
  std::vector<Position> points;
  for (const auto& [x, y, z] : cells)
    points.insert(points.end(), {{x, y, z}, {x - 1, y, z}, {x, y + 1, z}, {x, y, z - 2}});
  oracle::Random random(4);
  const int64_t edge = int64_t{1} << grid_levels;
  while (points.size() < kManyPoints)
    points.push_back({random.between(-1, edge), random.between(-1, edge), random.between(0, edge)});
  return points;
}

class TopCellsFile : public testing::TestWithParam<uint64_t> {};

INSTANTIATE_TEST_SUITE_P(NarrowAndWide, TopCellsFile,
                         testing::Values(global_layout::kNarrowLevelWords, 2));

TEST_P(TopCellsFile, LooksUpManyPoints) {
  const QueryFile file(random_voxels(6, 256), GetParam());
  const DagFile dag(file.path());
  ASSERT_TRUE(TopCells::serve(DagView(dag.file()), dag.grid_levels()));
  for (uint32_t levels = 0; levels <= dag.grid_levels(); ++levels) {
    SCOPED_TRACE(levels);
    const QueryFile::Cells cells = file.cells(levels);
    const std::vector<Position> points = points_of(cells, levels);
    expect_lookups(dag, levels, points, cells);
  }
}

TEST(TopCells, HaveTheNodesOfTheirGrid) {
  const QueryFile file(random_voxels(6, 256));
  const DagFile dag(file.path());
  const TopCells top(DagView(dag.file()));
  const QueryFile::Cells cells = file.cells(TopCells::kLevels), below = file.cells(6);
  for (int64_t x = 0; x < 32; ++x)
    for (int64_t y = 0; y < 32; ++y)
      for (int64_t z = 0; z < 32; ++z) {
        uint32_t mask = 0;
        for (int i = 0; i < 8; ++i)
          if (below.contains({2 * x + (i >> 2), 2 * y + (i >> 1 & 1), 2 * z + (i & 1)}))
            mask |= 1u << i;
        const auto [a, b, c] = std::array{static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                                          static_cast<uint32_t>(z)};
        ASSERT_EQ(top.at(a, b, c).mask(), mask);
      }
}

// A damaged node causes an error only for points whose descent visits this node. Lookups of other
// points succeed, although they start at the same table.
TEST(TopCells, LeaveDamageToThosePointsThatMeetIt) {
  const QueryFile file(random_voxels(6, 256));
  std::vector<Position> points;
  ByteString damaged = read_bytes(file.path());
  {
    const DagFile dag(file.path());
    const DagView::Children root = DagView(dag.file()).children(0, DagView(dag.file()).root());
    ASSERT_TRUE(root.has(0) && root.has(7));
    const auto* const last = reinterpret_cast<const unsigned char*>(
        &DagView(dag.file()).level(0).words[__builtin_popcount(root.mask)]);
    damaged[static_cast<size_t>(last - dag.file().data()) + 3] = 0x7f;
  }
  const std::string path = file.path() + ".damaged";
  write_bytes(path, damaged);
  const QueryFile::Cells cells = file.cells(8);
  oracle::Random random(5);
  while (points.size() < kManyPoints)
    points.push_back({random.between(0, 127), random.between(0, 127), random.between(0, 127)});
  const DagFile dag(path);
  std::vector<uint8_t> set(points.size());
  dag.lookup(points, 8, set);
  for (size_t i = 0; i < points.size(); ++i)
    ASSERT_EQ(set[i], cells.contains(points[i]) ? 1 : 0) << "point " << i;
  points[0] = {255, 255, 255};
  try {
    dag.lookup(points, 8, set);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    EXPECT_NE(error.message().find(path), std::string::npos);
  }
}

}  // namespace
