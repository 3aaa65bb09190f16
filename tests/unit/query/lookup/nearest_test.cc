#include "query/lookup/nearest.h"

#include "core/format/global/open_global.h"
#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

class NearestFinderTest : public Combine {};

// A finder that begins below the root finds the cells that a search from the root finds.
TEST_F(NearestFinderTest, FindsTheCellsOfASearchFromTheRoot) {
  constexpr int kEdge = 64;
  oracle::Random random(7);
  oracle::Voxels voxels(kEdge);
  const auto coordinate = [&] { return static_cast<int>(random.between(0, kEdge - 1)); };
  for (int i = 0; i < 400; ++i) voxels.set(coordinate(), coordinate(), coordinate());
  write_global(path("a"), voxels);
  const auto file = open_global_file(path("a"));
  const DagView dag(*file);
  for (const uint32_t levels : {4u, 6u}) {
    NearestFinder finder(dag, levels);
    const int64_t edge = int64_t{1} << levels;
    uint64_t compared = 0;
    for (int i = 0; i < 20'000; ++i) {
      const Position from = {random.between(0, edge - 1), random.between(0, edge - 1),
                             random.between(0, edge - 1)};
      const Nearest expected = find_nearest(dag, levels, from, ~uint64_t{0} >> 1);
      int64_t reach = 1;
      for (size_t axis = 0; axis < 3; ++axis)
        reach = std::max(reach, std::abs(expected.cell[axis] - from[axis]));
      const Nearest found = finder.find(from, static_cast<uint32_t>(reach));
      ASSERT_TRUE(found.found);
      ASSERT_EQ(found.cell, expected.cell);
      ASSERT_EQ(found.squared_distance, expected.squared_distance);
      compared += reach > 2;
    }
    EXPECT_TRUE(levels == 4 || compared > 1000);
  }
}

// A cell on an axis can be nearer than a cell within the reach.
TEST_F(NearestFinderTest, FindsCellsBeyondTheReach) {
  oracle::Voxels voxels(64);
  voxels.set(28 + 3, 28 + 3, 28 + 3);
  voxels.set(28, 28, 28 + 5);
  write_global(path("a"), voxels);
  const auto file = open_global_file(path("a"));
  const DagView dag(*file);
  const Position expected = {28, 28, 33};
  EXPECT_EQ(NearestFinder(dag, 6).find({28, 28, 28}, 3).cell, expected);
}

}  // namespace
}  // namespace voxdag::query
