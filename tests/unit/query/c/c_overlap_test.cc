// Tests bricks and collision queries of voxdag.h. The expected results come from a search of all
// set cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "query/c/voxdag.h"
#include "voxdag/query.h"

namespace voxdag::query {
namespace {

class COverlapTest : public testing::Test {
 protected:
  static constexpr const char* kFile = VOXDAG_SOURCE_DIR "/tests/golden/floor_and_pillar.vdag";
  void SetUp() override { ASSERT_EQ(voxdag_open(kFile, &file_), VOXDAG_OK) << voxdag_error(); }
  void TearDown() override { voxdag_close(file_); }
  std::vector<Position> cells(uint32_t levels) const {
    const Selection all{levels, whole_grid(levels)};
    std::vector<Position> found(dag_.count(all));
    dag_.positions(all, found);
    return found;
  }
  double voxels_per_cell(uint32_t levels) const {
    return static_cast<double>(int64_t{1} << (dag_.grid_levels() - levels));
  }

  const DagFile dag_{kFile};
  voxdag_file* file_ = nullptr;
};

// Returns the distance of a point from a cell; 0 inside it. `edge` is the edge of a cell, in
// voxels.
double distance(const std::array<double, 3>& point, const Position& cell, double edge) {
  double sum = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double low = static_cast<double>(cell[axis]) * edge;
    const double away = std::max({low - point[axis], point[axis] - low - edge, 0.0});
    sum += away * away;
  }
  return std::sqrt(sum);
}

TEST_F(COverlapTest, BricksAreListed) {
  const uint32_t levels = dag_.grid_levels();
  const int64_t edge = dag_.resolution();
  const voxdag_region region = {{1, 0, 0}, {edge, edge - 1, edge}};
  size_t count = 0;
  ASSERT_EQ(voxdag_bricks(file_, levels, &region, 0, nullptr, &count), VOXDAG_OK);
  ASSERT_GT(count, 1u);
  std::vector<voxdag_brick> bricks(count);
  ASSERT_EQ(voxdag_bricks(file_, levels, &region, count, bricks.data(), &count), VOXDAG_OK);
  size_t i = 0;
  dag_.bricks({levels, {{1, 0, 0}, {edge, edge - 1, edge}}}, [&](const Brick& brick) {
    EXPECT_EQ(bricks[i].mask, brick.mask);
    EXPECT_TRUE(std::equal(brick.low.begin(), brick.low.end(), bricks[i].low));
    ++i;
  });
  EXPECT_EQ(i, count);
  EXPECT_EQ(voxdag_bricks(file_, levels, &region, 1, nullptr, &count), VOXDAG_INVALID_INPUT);
}

TEST_F(COverlapTest, BoxesOverlapTheCellsInside) {
  std::mt19937 random(3);
  const auto limit = static_cast<double>(dag_.resolution());
  std::uniform_int_distribution<int> at(-2, static_cast<int>(limit) + 2), size(0, 6);
  int hits = 0;
  for (const uint32_t levels : {dag_.grid_levels(), dag_.grid_levels() - 2})
    for (int i = 0; i < 100; ++i) {
      voxdag_box box{};
      for (size_t axis = 0; axis < 3; ++axis) {
        box.low[axis] = at(random);
        box.high[axis] = box.low[axis] + size(random) + 0.5 * (i % 2);
      }
      bool expected = false;
      const double edge = voxels_per_cell(levels);
      for (const Position& cell : cells(levels)) {
        bool inside = true;
        for (size_t axis = 0; axis < 3; ++axis) {
          const double low = static_cast<double>(cell[axis]) * edge;
          inside = inside && box.low[axis] < low + edge && box.high[axis] > low;
        }
        expected = expected || inside;
      }
      uint8_t found = 2;
      ASSERT_EQ(voxdag_overlap_boxes(file_, levels, &box, 1, &found), VOXDAG_OK);
      ASSERT_EQ(found, expected) << i;
      hits += found;
    }
  EXPECT_GT(hits, 10);
  EXPECT_LT(hits, 190);
}

// The expected result comes from the distance between the cells and sampled points of the capsule's
// segment. This distance is inexact, so a capsule is left out if the distance is nearly its radius.
TEST_F(COverlapTest, CapsulesOverlapTheCellsWithinTheirRadius) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(-3, static_cast<double>(dag_.resolution()) + 3);
  int hits = 0, misses = 0;
  const uint32_t levels = dag_.grid_levels();
  const std::vector<Position> all = cells(levels);
  for (int i = 0; i < 60; ++i) {
    voxdag_capsule capsule{};
    for (size_t axis = 0; axis < 3; ++axis) {
      capsule.from[axis] = at(random);
      capsule.to[axis] = i % 3 ? capsule.from[axis] + std::fmod(at(random), 5) : capsule.from[axis];
    }
    capsule.radius = 0.5 + i % 5;
    double nearest = HUGE_VAL;
    for (int step = 0; step <= 100; ++step) {
      std::array<double, 3> point;
      for (size_t axis = 0; axis < 3; ++axis)
        point[axis] = capsule.from[axis] + (capsule.to[axis] - capsule.from[axis]) * step / 100;
      for (const Position& cell : all) nearest = std::min(nearest, distance(point, cell, 1));
    }
    if (std::abs(nearest - capsule.radius) < 0.1) continue;
    uint8_t found = 2;
    ASSERT_EQ(voxdag_overlap_capsules(file_, levels, &capsule, 1, &found), VOXDAG_OK);
    ASSERT_EQ(found, nearest < capsule.radius) << i << ", distance " << nearest;
    ++(found ? hits : misses);
  }
  EXPECT_GT(hits, 5);
  EXPECT_GT(misses, 5);
}

TEST_F(COverlapTest, WrongShapesAreErrors) {
  const voxdag_capsule nowhere = {{NAN, 0, 0}, {0, 0, 0}, 1};
  uint8_t found = 2;
  EXPECT_EQ(voxdag_overlap_capsules(file_, 2, &nowhere, 1, &found), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_overlap_boxes(file_, 2, nullptr, 1, &found), VOXDAG_INVALID_INPUT);
  const voxdag_box box = {{0, 0, 0}, {1, 1, 1}};
  EXPECT_EQ(voxdag_overlap_boxes(file_, 40, &box, 1, &found), VOXDAG_INVALID_INPUT);
}

}  // namespace
}  // namespace voxdag::query
