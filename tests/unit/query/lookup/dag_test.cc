#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <tuple>

#include "core/format/global/voxdag_reader.h"
#include "core/geometry/morton.h"
#include "tests/unit/query/query_files.h"
#include "voxdag/query.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

uint64_t morton_of(const Position& p) {
  return morton_encode(static_cast<uint32_t>(p[0]), static_cast<uint32_t>(p[1]),
                       static_cast<uint32_t>(p[2]));
}

bool is_within(const Region& region, const Position& p) {
  for (size_t axis = 0; axis < 3; ++axis)
    if (p[axis] < region.low[axis] || p[axis] >= region.high[axis]) return false;
  return true;
}

// Returns regions of a grid: the complete grid, boxes in the grid, across its boundary and outside
// it, and empty boxes.
std::vector<Region> regions_of(uint32_t grid_levels, uint64_t seed) {
  const int64_t edge = int64_t{1} << grid_levels;
  std::vector<Region> regions = {whole_grid(grid_levels),
                                 {{-5, -5, -5}, {edge + 5, edge + 5, edge + 5}},
                                 {{edge, 0, 0}, {edge + 3, 4, 4}},
                                 {{1, 1, 1}, {1, 3, 3}},
                                 {{-3, 1, -2}, {2, edge, 3}}};
  oracle::Random random(seed);
  for (int i = 0; i < 30; ++i) {
    Region r;
    for (size_t axis = 0; axis < 3; ++axis) {
      r.low[axis] = random.between(-2, edge);
      r.high[axis] = r.low[axis] + random.between(1, i % 2 ? 6 : edge);
    }
    regions.push_back(r);
  }
  return regions;
}

// Compares the functions of DagFile with brute force, for every level of files of three sizes. The
// pointers in the files have 32 bits or 64 bits (wide levels).
class DagFileTest : public testing::TestWithParam<std::tuple<int, uint64_t>> {
 protected:
  DagFileTest()
      : file_(random_voxels(static_cast<uint64_t>(std::get<0>(GetParam())) + 3,
                            std::get<0>(GetParam())),
              std::get<1>(GetParam())),
        dag_(file_.path()) {}

  const QueryFile file_;
  const DagFile dag_;
};

INSTANTIATE_TEST_SUITE_P(AllSizes, DagFileTest,
                         testing::Combine(testing::Values(4, 8, 32),
                                          testing::Values(global_layout::kNarrowLevelWords, 2)));

TEST_P(DagFileTest, LooksUpEveryCell) {
  for (uint32_t levels = 0; levels <= dag_.grid_levels(); ++levels) {
    SCOPED_TRACE(levels);
    const QueryFile::Cells cells = file_.cells(levels);
    const int64_t edge = int64_t{1} << levels;
    std::vector<Position> points;
    for (int64_t x = -1; x <= edge; ++x)
      for (int64_t y = -1; y <= edge; ++y)
        for (int64_t z = -1; z <= edge; ++z) points.push_back({x, y, z});
    points.insert(points.end(), {{INT64_MIN, 0, 0}, {0, INT64_MAX, 0}, {0, 0, int64_t{1} << 32}});
    expect_lookups(dag_, levels, points, cells);
  }
}

TEST_P(DagFileTest, CountsAndListsAndFillsRegions) {
  for (uint32_t levels = 0; levels <= dag_.grid_levels(); ++levels) {
    const QueryFile::Cells cells = file_.cells(levels);
    for (const Region& region : regions_of(levels, levels)) {
      SCOPED_TRACE(testing::Message()
                   << levels << " levels, from " << region.low[0] << " " << region.low[1] << " "
                   << region.low[2] << " to " << region.high[0] << " " << region.high[1] << " "
                   << region.high[2]);
      std::vector<Position> expected;
      std::copy_if(cells.begin(), cells.end(), std::back_inserter(expected),
                   [&](const Position& p) { return is_within(region, p); });
      std::sort(expected.begin(), expected.end(),
                [](const Position& a, const Position& b) { return morton_of(a) < morton_of(b); });
      const Selection selection{levels, region};
      ASSERT_EQ(dag_.count(selection), expected.size());
      std::vector<Position> listed(expected.size());
      ASSERT_EQ(dag_.positions(selection, listed), expected.size());
      ASSERT_EQ(listed, expected);
      std::vector<uint8_t> dense, dense_expected;
      for (int64_t x = region.low[0]; x < region.high[0]; ++x)
        for (int64_t y = region.low[1]; y < region.high[1]; ++y)
          for (int64_t z = region.low[2]; z < region.high[2]; ++z)
            dense_expected.push_back(cells.contains({x, y, z}) ? 1 : 0);
      dense.resize(dense_expected.size(), 7);
      dag_.box(selection, dense);
      ASSERT_EQ(dense, dense_expected);
    }
  }
}

// count() gives the same results if DagFile has no memory to store the counts of nodes.
TEST_P(DagFileTest, CountsWithoutStoredCounts) {
  const DagFile poor(file_.path(), 0);
  for (uint32_t levels = 0; levels <= dag_.grid_levels(); ++levels)
    for (const Region& region : regions_of(levels, 100 + levels))
      ASSERT_EQ(poor.count({levels, region}), dag_.count({levels, region}));
}

// If the caller's list is too short, positions() fills it and returns the number of all cells.
TEST_P(DagFileTest, ListsAsManyAsFit) {
  const Selection all{dag_.grid_levels(), whole_grid(dag_.grid_levels())};
  std::vector<Position> some(3), every(dag_.count(all));
  EXPECT_EQ(dag_.positions(all, some), every.size());
  dag_.positions(all, every);
  EXPECT_TRUE(std::equal(some.begin(), some.end(), every.begin()));
}

TEST_P(DagFileTest, VisitsBricksInMortonOrder) {
  for (uint32_t levels = 2; levels <= dag_.grid_levels(); ++levels) {
    std::vector<uint64_t> codes;
    dag_.bricks({levels, whole_grid(levels)}, [&](const Brick& brick) {
      EXPECT_NE(brick.mask, 0u);
      for (const int64_t c : brick.low) EXPECT_EQ(c % 4, 0);
      codes.push_back(morton_of(brick.low));
    });
    EXPECT_EQ(std::adjacent_find(codes.begin(), codes.end(), std::greater_equal<>()), codes.end());
  }
}

// Finds the nearest cell by trying every cell.
Nearest try_every_cell(const QueryFile::Cells& cells, const Position& from, double max_distance) {
  Nearest best;
  for (const Position& p : cells) {
    uint64_t squared = 0;
    for (size_t axis = 0; axis < 3; ++axis)
      squared += static_cast<uint64_t>((p[axis] - from[axis]) * (p[axis] - from[axis]));
    if (static_cast<double>(squared) > max_distance * max_distance) continue;
    if (!best.found || squared < best.squared_distance ||
        (squared == best.squared_distance && morton_of(p) < morton_of(best.cell)))
      best = {p, squared, true};
  }
  return best;
}

TEST_P(DagFileTest, FindsTheNearestCell) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  for (uint32_t levels = 0; levels <= dag_.grid_levels(); ++levels) {
    const QueryFile::Cells cells = file_.cells(levels);
    const int64_t edge = int64_t{1} << levels;
    oracle::Random random(levels);
    std::vector<Position> points = {{kMaxCoordinate, -kMaxCoordinate, 5}};
    for (int i = 0; i < 60; ++i)
      points.push_back({random.between(-edge, 2 * edge), random.between(-edge, 2 * edge),
                        random.between(-edge, 2 * edge)});
    for (const double max_distance : {0.0, 2.5, kFar}) {
      std::vector<Nearest> found(points.size()), found_by_four(points.size());
      dag_.nearest(points, levels, max_distance, found);
      dag_.nearest(points, levels, max_distance, found_by_four, 4);
      for (size_t i = 0; i < points.size(); ++i) {
        const Nearest expected = try_every_cell(cells, points[i], max_distance);
        ASSERT_EQ(found[i].found, expected.found);
        ASSERT_EQ(found[i].cell, expected.cell);
        ASSERT_EQ(found[i].squared_distance, expected.squared_distance);
        ASSERT_EQ(found_by_four[i].cell, expected.cell);
      }
    }
  }
}

// If several cells are equally near, nearest() returns the cell with the lowest Morton code,
// independent of the search order.
TEST(Dag, BreaksTiesByMortonCode) {
  oracle::Voxels voxels(16);
  for (const int x : {6, 10})
    for (const int y : {6, 10})
      for (const int z : {6, 10}) voxels.set(x, y, z);
  const QueryFile file(voxels);
  const DagFile dag(file.path());
  const std::vector<Position> points = {{8, 8, 8}, {8, 8, 9}, {10, 8, 8}};
  std::vector<Nearest> found(points.size());
  dag.nearest(points, 4, 100, found);
  EXPECT_EQ(found[0].cell, (Position{6, 6, 6}));
  EXPECT_EQ(found[1].cell, (Position{6, 6, 10}));
  EXPECT_EQ(found[2].cell, (Position{10, 6, 6}));
}

TEST(Dag, AnswersForAnEmptyFile) {
  const QueryFile file(oracle::Voxels(16));
  const DagFile dag(file.path());
  const std::vector<Position> points(3);
  std::vector<uint8_t> set(3, 7);
  dag.lookup(points, 4, set);
  EXPECT_EQ(set, std::vector<uint8_t>(3, 0));
  const Selection all{4, whole_grid(4)};
  EXPECT_EQ(dag.count(all), 0u);
  EXPECT_EQ(dag.positions(all, {}), 0u);
  std::vector<Nearest> found(3);
  dag.nearest(points, 4, 100, found);
  EXPECT_FALSE(found[0].found);
  const std::vector<Coordinates> origins = {{8, 8, -1}}, directions = {{0, 0, 1}};
  std::vector<RayHit> hits(1);
  dag.rays(origins, directions, {}, hits);
  EXPECT_FALSE(hits[0].hit);
}

TEST(Dag, RefusesWrongArguments) {
  const QueryFile file(random_voxels(5, 16));
  const DagFile dag(file.path());
  const std::vector<Position> points(2), far(1, {kMaxCoordinate + 1, 0, 0});
  std::vector<uint8_t> set(3);
  std::vector<Nearest> found(1);
  const auto code_of = [](const auto& run) { return error_of(run).code(); };
  EXPECT_EQ(code_of([&] { dag.lookup(points, 4, set); }), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] { dag.lookup(points, 5, std::span(set).first(2)); }),
            ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] { dag.count({5, whole_grid(4)}); }), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] { dag.box({4, whole_grid(4)}, set); }), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] {
              dag.box({4, {{INT64_MIN, INT64_MIN, 0}, {INT64_MAX, INT64_MAX, 1}}}, set);
            }),
            ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] { dag.nearest(far, 4, 1, found); }), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] { dag.nearest(points, 4, -1, found); }), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of([&] { DagFile nothing(file.path() + ".not"); }), ErrorCode::kNotFound);
}

// A query of a file with damaged bytes returns any result, or fails with an error that names the
// file. It reads nothing outside the file; the address sanitizer checks this.
TEST(Dag, SurvivesDamage) {
  for (const uint64_t narrow_words : {global_layout::kNarrowLevelWords, uint64_t{2}}) {
    const QueryFile file(random_voxels(11, 32), narrow_words);
    const ByteString whole = read_bytes(file.path());
    const uint64_t levels_end = DagFile(file.path()).file().checksum_table_offset();
    oracle::Random random(17);
    int errors = 0;
    for (int i = 0; i < 50; ++i) {
      ByteString damaged = whole;
      for (int flips = 0; flips < 20; ++flips)
        damaged[static_cast<size_t>(random.between(4096, static_cast<int64_t>(levels_end) - 1))] ^=
            static_cast<char>(random.between(1, 255));
      const std::string path = file.path() + ".damaged";
      write_bytes(path, damaged);
      const DagFile dag(path);
      const auto tries = [&](const auto& run) {
        try {
          run();
        } catch (const Error& error) {
          ASSERT_EQ(error.code(), ErrorCode::kCorrupt);
          ASSERT_NE(error.message().find(path), std::string::npos);
          ++errors;
        }
      };
      std::vector<Position> points;
      std::vector<Coordinates> origins, directions;
      for (int k = 0; k < 200; ++k) {
        points.push_back({random.between(0, 31), random.between(0, 31), random.between(0, 31)});
        origins.push_back({-1, static_cast<double>(points.back()[1]) + 0.5, 3.5});
        directions.push_back({1, 0.01, static_cast<double>(points.back()[2]) / 32});
      }
      std::vector<uint8_t> set(points.size());
      std::vector<Nearest> found(points.size());
      std::vector<RayHit> hits(points.size());
      std::vector<uint8_t> cells(32 * 32 * 32);
      const Selection all{5, whole_grid(5)};
      tries([&] { dag.lookup(points, 5, set); });
      tries([&] { dag.nearest(points, 5, 1000, found); });
      tries([&] { dag.rays(origins, directions, {}, hits); });
      tries([&] { dag.occluded(origins, directions, {}, set); });
      tries([&] { dag.box(all, cells); });
      tries([&] { dag.count(all); });
      tries([&] { DagFile(path, 0).count({4, whole_grid(3)}); });
    }
    EXPECT_GT(errors, 30);
  }
}

}  // namespace
