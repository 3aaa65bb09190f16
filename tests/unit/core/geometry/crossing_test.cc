#include "core/geometry/crossing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "tests/oracle/scenes.h"
#include "tests/oracle/solid/crossing.h"
#include "tests/oracle/solid/solids.h"

namespace voxdag {
namespace {

using oracle::Point;
using oracle::Random;
using oracle::Triangle;

FixedTriangle fixed(const Triangle& t) {
  FixedTriangle out;
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) out.v[i][a] = t[i][a];
  return out;
}

struct Counts {
  int crossed = 0, missed = 0, ties = 0;
};

// Compares one type of RowTest (core/geometry/crossing.h) with the oracle, for the row along `axis`
// through p.
template <class Test>
void expect_right(const Triangle& t, const Point& p, int axis, Counts& counts) {
  const oracle::Crossing truth = oracle::crossing_of(t, p, axis);
  const Test test(fixed(t), axis);
  const int64_t at[3] = {p[0], p[1], p[2]};
  ASSERT_EQ(test.crosses(at), truth.exists);
  (truth.exists ? counts.crossed : counts.missed)++;
  if (!truth.exists) return;
  ASSERT_EQ(test.sign(), truth.sign);
  for (const int step_log2 : {1, 8, 11}) {
    Point q = p;
    const int64_t first = test.first_beyond(p[(axis + 1) % 3], p[(axis + 2) % 3], step_log2);
    q[axis] = first * (int64_t{1} << step_log2);
    ASSERT_TRUE(oracle::crossing_of(t, q, axis).is_before) << "step 2^" << step_log2;
    q[axis] -= int64_t{1} << step_log2;
    ASSERT_FALSE(oracle::crossing_of(t, q, axis).is_before) << "step 2^" << step_log2;
  }
}

template <class Test>
void expect_beyond_right(const Triangle& t, const Point& p, int axis) {
  const oracle::Crossing truth = oracle::crossing_of(t, p, axis);
  const int64_t at[3] = {p[0], p[1], p[2]};
  if (!truth.exists) return;
  ASSERT_EQ(Test(fixed(t), axis).is_beyond(at), truth.is_before);
}

// Compares each type of RowTest whose integers are wide enough for the triangle.
void expect_all_right(const Triangle& t, const Point& p, int axis, Counts& counts) {
  expect_right<WideRowTest>(t, p, axis, counts);
  expect_beyond_right<WideRowTest>(t, p, axis);
  Counts other;
  if (!has_row_coordinates(fixed(t))) return;
  expect_right<GridRowTest>(t, p, axis, other);
  expect_beyond_right<GridRowTest>(t, p, axis);
  if (!has_row_extents(fixed(t))) return;
  expect_right<NarrowRowTest>(t, p, axis, other);
  bool is_near = true;
  for (int a = 0; a < 3; ++a) is_near &= std::abs(p[a] - t[0][a]) < kRowExtent;
  if (is_near) expect_beyond_right<NarrowRowTest>(t, p, axis);
}

// Returns a point with even coordinates near the triangle.
Point point_near(const Triangle& t, int grain_log2, Random& random) {
  Point p;
  const int64_t a = random.between(0, 1024), b = random.between(0, 1024 - a), c = 1024 - a - b;
  for (int k = 0; k < 3; ++k) {
    const int64_t at = (a * t[0][k] + b * t[1][k] + c * t[2][k]) / 1024;
    p[k] = ((at >> grain_log2) + random.between(0, 1)) * (int64_t{1} << grain_log2);
  }
  return p;
}

TEST(Crossing, EqualsTheOracle) {
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    Random random(400 + static_cast<uint64_t>(kind));
    Counts counts;
    for (int i = 0; i < 6000; ++i) {
      const oracle::Region region{{random.between(0, 1 << 10) * 64, random.between(0, 512) * 64, 0},
                                  4 << random.between(0, 6)};
      const Triangle t = oracle::make_scene(kind, static_cast<uint64_t>(i), region, 1).front();
      const Point p = point_near(t, i % 3 == 0 ? 1 : 7, random);
      expect_all_right(t, p, i % 3, counts);
      if (HasFatalFailure()) FAIL() << oracle::kind_name(kind) << ", pair " << i;
    }
    SCOPED_TRACE(oracle::kind_name(kind));
    if (kind != oracle::SceneKind::kDegenerate && kind != oracle::SceneKind::kSliver) {
      EXPECT_GT(counts.crossed, 500);
    }
    EXPECT_GT(counts.missed, 500);
  }
}

bool is_on_plane(const Triangle& t, const Point& p) {
  int64_t volume = 0;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    volume += (p[a] - t[0][a]) * ((t[1][b] - t[0][b]) * (t[2][c] - t[0][c]) -
                                  (t[1][c] - t[0][c]) * (t[2][b] - t[0][b]));
  }
  return volume == 0;
}

// Coordinates are small numbers, so rows often pass exactly through edges and planes of triangles.
TEST(Crossing, EqualsTheOracleForTies) {
  Random random(8);
  Counts counts;
  int on_edge = 0, on_plane = 0;
  for (int i = 0; i < 60000; ++i) {
    Triangle t;
    for (Point& p : t)
      for (int64_t& u : p) u = random.odd(-5, 9);
    const Point p = {2 * random.between(-2, 4), 2 * random.between(-2, 4),
                     2 * random.between(-2, 4)};
    const int axis = i % 3, b = (axis + 1) % 3, c = (axis + 2) % 3;
    expect_all_right(t, p, axis, counts);
    if (HasFatalFailure()) FAIL() << "pair " << i;
    for (int e = 0; e < 3; ++e) {
      const Point &u = t[e], &w = t[(e + 1) % 3];
      on_edge += (w[b] - u[b]) * (p[c] - u[c]) == (w[c] - u[c]) * (p[b] - u[b]);
    }
    on_plane += oracle::crossing_of(t, p, axis).exists && is_on_plane(t, p);
  }
  EXPECT_GT(counts.crossed, 3000);
  EXPECT_GT(on_edge, 3000);
  EXPECT_GT(on_plane, 50);
}

TEST(Crossing, EqualsTheOracleAtTheLimits) {
  Random random(9);
  const int64_t reaches[] = {kRowExtent / 2, int64_t{1} << 28, kRowCoordinate, oracle::kWidest + 1};
  for (const int64_t reach : reaches) {
    Counts counts;
    for (int i = 0; i < 8000; ++i) {
      Triangle t;
      for (Point& p : t)
        for (int64_t& u : p)
          u = random.coin() ? random.odd(-reach, reach) : random.coin() ? reach - 1 : 1 - reach;
      expect_all_right(t, point_near(t, i % 2 ? 1 : 11, random), i % 3, counts);
      if (HasFatalFailure()) FAIL() << "reach " << reach << ", pair " << i;
    }
    EXPECT_GT(counts.crossed, 1000);
  }
}

// Returns the sum of the signs of the crossings that the tested code finds on the row through p,
// before p. Sets `total` to the sum for the complete row.
int winding_at(const oracle::Triangles& mesh, const Point& p, int axis, int* total) {
  const int64_t at[3] = {p[0], p[1], p[2]};
  int sum = 0;
  *total = 0;
  for (const Triangle& t : mesh)
    with_row_test(fixed(t), axis, [&](const auto& test) {
      if (!test.crosses(at)) return;
      *total += test.sign();
      if (test.is_beyond(at)) sum += test.sign();
    });
  return sum;
}

// On closed meshes, the signs on each row sum to 0, and the three rows through a point give the
// same winding number, also for rows that pass exactly through edges or planes of triangles.
TEST(Crossing, ClosesClosedMeshes) {
  for (const oracle::SolidKind kind : oracle::kClosedSolids) {
    SCOPED_TRACE(oracle::kind_name(kind));
    const oracle::Triangles mesh = oracle::make_solid(kind, 3, 8);
    bool is_inside_once = false;
    for (int64_t x = 0; x <= 16; ++x)
      for (int64_t y = 0; y <= 16; ++y)
        for (int64_t z = 0; z <= 16; ++z) {
          const Point p = {128 * x, 128 * y, 128 * z};
          int winding[3], total[3];
          for (int a = 0; a < 3; ++a) {
            winding[a] = winding_at(mesh, p, a, &total[a]);
            ASSERT_EQ(total[a], 0);
            ASSERT_EQ(winding[a], oracle::winding_number(mesh, p, a));
          }
          ASSERT_EQ(winding[0], winding[1]);
          ASSERT_EQ(winding[1], winding[2]);
          is_inside_once |= winding[0] != 0;
        }
    EXPECT_EQ(is_inside_once, kind != oracle::SolidKind::kCanceled);
  }
}

// The rows that a triangle crosses depend neither on its first vertex nor on its orientation.
TEST(Crossing, DependsOnOrientationOnlyInTheSign) {
  Random random(10);
  for (int i = 0; i < 20000; ++i) {
    Triangle t;
    for (Point& p : t)
      for (int64_t& u : p) u = random.odd(-300, 300);
    const Point p = point_near(t, 7, random);
    const int64_t from[3] = {p[0], p[1], p[2]};
    const int sign = leg_crossing(fixed(t), from, i % 3, 256);
    ASSERT_EQ(sign, oracle::leg_crossing(t, p, i % 3, 256));
    ASSERT_EQ(leg_crossing(fixed({t[1], t[2], t[0]}), from, i % 3, 256), sign);
    ASSERT_EQ(leg_crossing(fixed({t[0], t[2], t[1]}), from, i % 3, 256), -sign);
  }
}

}  // namespace
}  // namespace voxdag
