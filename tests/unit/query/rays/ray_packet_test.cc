#include "query/rays/ray_packet.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <vector>

#include "tests/unit/query/query_files.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

constexpr double kFarAway = 1e30;

// Returns rays that start in and around a grid of this edge: rays of one camera, random rays, rays
// along axes and diagonals, and rays through edges and corners of cells.
std::vector<Ray> many_rays(int edge, uint64_t seed) {
  oracle::Random random(seed);
  const auto anywhere = [&](int64_t low, int64_t high) {
    return static_cast<double>(random.between(low * 1024, high * 1024)) / 1024;
  };
  std::vector<Ray> rays;
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 24; ++x)
      rays.push_back({{{-1.3 * edge, 0.7 * edge, -0.9 * edge}},
                      normalized({{1, 0.02 * x - 0.6, 0.02 * y + 0.4}})});
  for (int i = 0; i < 4000; ++i) {
    Vec origin, direction;
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = anywhere(-edge, 2 * edge);
      direction[axis] = anywhere(-1, 1);
      if (i % 4 == 1) origin[axis] = std::floor(origin[axis]);
      if (i % 4 >= 2) {
        origin[axis] = static_cast<double>(random.between(-edge, 2 * edge)) / (i % 3 == 0 ? 2 : 1);
        direction[axis] = static_cast<double>(random.between(-1, 1));
      }
    }
    if (length(direction) > 0) rays.push_back({origin, normalized(direction)});
  }
  return rays;
}

void expect_equal(WalkPacket walk, const DagView& dag, const std::vector<Ray>& rays,
                  double stop_size, double t_min, double t_max, size_t packet_rays,
                  uint64_t& hits) {
  const RayCaster caster(dag);
  const auto packet = std::make_unique<RayPacket>(dag, stop_size, t_min, t_max, walk);
  Hit found[RayPacket::kRays];
  for (size_t first = 0; first < rays.size(); first += packet_rays) {
    const size_t count = std::min(packet_rays, rays.size() - first);
    const uint64_t have_hit = packet->cast(std::span(rays).subspan(first, count), found);
    ASSERT_EQ(packet->occluded(std::span(rays).subspan(first, count)), have_hit);
    for (size_t i = 0; i < count; ++i) {
      Hit hit;
      const bool expected = caster.cast(rays[first + i], {stop_size, 0}, t_min, t_max, hit);
      ASSERT_EQ(static_cast<bool>(have_hit >> i & 1), expected) << "ray " << first + i;
      ASSERT_EQ(caster.occluded(rays[first + i], {stop_size, 0}, t_min, t_max), expected);
      if (!expected) continue;
      ++hits;
      ASSERT_EQ(found[i].t, hit.t) << "ray " << first + i;
      ASSERT_EQ(found[i].axis, hit.axis) << "ray " << first + i;
      ASSERT_EQ(found[i].depth, hit.depth) << "ray " << first + i;
      for (int axis = 0; axis < 3; ++axis) ASSERT_EQ(found[i].cell[axis], hit.cell[axis]);
    }
    ASSERT_EQ(have_hit & ~(~uint64_t{0} >> (64 - count)), 0u);
  }
}

// Checks that packets give bit-identical results to RayCaster, which casts single rays. The files
// have different sizes, and pointers of 32 bits or of 64 bits (wide levels).
void expect_single_rays(WalkPacket walk) {
  uint64_t hits = 0;
  for (const int edge : {4, 8, 64})
    for (const uint64_t narrow_words : {global_layout::kNarrowLevelWords, uint64_t{2}}) {
      SCOPED_TRACE(edge);
      const QueryFile file(random_voxels(static_cast<uint64_t>(edge), edge), narrow_words);
      const DagFile dag(file.path());
      const std::vector<Ray> rays = many_rays(edge, 5);
      expect_equal(walk, DagView(dag.file()), rays, 0, 0, kFarAway, 64, hits);
      expect_equal(walk, DagView(dag.file()), rays, 0, 0, std::numeric_limits<double>::infinity(),
                   33, hits);
      expect_equal(walk, DagView(dag.file()), rays, 0, 0, edge, 7, hits);
      for (const double stop : {1.0, 2.0, 5.5, 2.0 * edge})
        expect_equal(walk, DagView(dag.file()), rays, stop, 0.25 * edge, kFarAway, 64, hits);
    }
  EXPECT_GT(hits, 20000u);
}

TEST(RayPacket, EqualsTheCasterOfSingleRays) { expect_single_rays(walk_packet_portable); }

TEST(RayPacket, EqualsTheCasterOfSingleRaysWithAvx2) {
  if (!walk_packet_avx2()) GTEST_SKIP() << "this machine has no AVX2";
  expect_single_rays(walk_packet_avx2());
}

class DagRays : public testing::Test {
 protected:
  static oracle::Voxels one_voxel() {
    oracle::Voxels voxels(16);
    voxels.set(5, 6, 7);
    return voxels;
  }
  RayHit cast(const Coordinates& origin, const Coordinates& direction,
              const RayLimits& limits = {}) const {
    RayHit hit;
    dag_.rays({&origin, 1}, {&direction, 1}, limits, {&hit, 1});
    return hit;
  }

  const QueryFile file_{one_voxel()};
  const DagFile dag_{file_.path()};
};

// Distances are in voxels, whatever the length of the direction. The normal of a hit points against
// the ray.
TEST_F(DagRays, MeasuresInVoxels) {
  for (const double length : {1e-300, 0.5, 1.0, 1e300}) {
    RayHit hit = cast({-3, 6.5, 7.5}, {length, 0, 0});
    ASSERT_TRUE(hit.hit);
    EXPECT_EQ(hit.distance, 8);
    EXPECT_EQ(hit.cell, (Position{5, 6, 7}));
    EXPECT_EQ(hit.grid_levels, 4u);
    EXPECT_EQ(hit.axis, 0);
    EXPECT_EQ(hit.sign, -1);
    hit = cast({5.5, 20, 7.5}, {0, -length, 0});
    ASSERT_TRUE(hit.hit);
    EXPECT_EQ(hit.distance, 13);
    EXPECT_EQ(hit.axis, 1);
    EXPECT_EQ(hit.sign, 1);
  }
}

TEST_F(DagRays, BeginsInAVoxel) {
  const RayHit hit = cast({5.5, 6.5, 7.5}, {0.3, -1, 0});
  ASSERT_TRUE(hit.hit);
  EXPECT_EQ(hit.distance, 0);
  EXPECT_EQ(hit.axis, -1);
  EXPECT_EQ(hit.sign, 0);
}

TEST_F(DagRays, KeepsToItsLimits) {
  EXPECT_TRUE(cast({-3, 6.5, 7.5}, {1, 0, 0}, {8, 0}).hit);
  EXPECT_FALSE(cast({-3, 6.5, 7.5}, {1, 0, 0}, {7.9, 0}).hit);
  EXPECT_FALSE(cast({-3, 4.5, 7.5}, {1, 0, 0}).hit);
  const RayHit hit = cast({-3, 4.5, 7.5}, {1, 0, 0}, {100, 4});
  ASSERT_TRUE(hit.hit);
  EXPECT_EQ(hit.grid_levels, 2u);
  EXPECT_EQ(hit.cell, (Position{1, 1, 1}));
  EXPECT_EQ(hit.distance, 7);
}

TEST_F(DagRays, RefusesWhatIsNoRay) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = 1 / 0.0;
  const auto code_of = [&](const Coordinates& origin, const Coordinates& direction,
                           const RayLimits& limits = {}) {
    return error_of([&] { cast(origin, direction, limits); }).code();
  };
  EXPECT_EQ(code_of({0, 0, 0}, {nan, 1, 0}), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of({0, 0, 0}, {0, 0, 0}), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of({0, inf, 0}, {0, 0, 1}), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of({0, 0, 0}, {0, 0, inf}), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of({0, 0, 0}, {0, 0, 1}, {nan, 0}), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of({0, 0, 0}, {0, 0, 1}, {1, -1}), ErrorCode::kInvalidInput);
}

// occluded() and rays() agree for all limits of distance and size, also for limits that equal the
// distance of a hit or differ from it by one bit.
TEST(DagOccluded, EqualsTheRaysWithAHit) {
  uint64_t occluded = 0, open = 0;
  for (const int edge : {4, 16, 64}) {
    const QueryFile file(random_voxels(static_cast<uint64_t>(edge) + 1, edge));
    const DagFile dag(file.path());
    std::vector<Coordinates> origins, directions;
    for (const Ray& ray : many_rays(edge, 23)) {
      origins.push_back({ray.origin[0], ray.origin[1], ray.origin[2]});
      directions.push_back({ray.direction[0], ray.direction[1], ray.direction[2]});
    }
    std::vector<RayHit> hits(origins.size());
    std::vector<uint8_t> found(origins.size(), 2);
    for (const double stop_size : {0.0, 1.0, 2.0, 4.0, 2.0 * edge})
      for (const double distance : {0.0, 0.5, 1.0, 0.75 * edge, kFarAway}) {
        dag.rays(origins, directions, {distance, stop_size}, hits);
        dag.occluded(origins, directions, {distance, stop_size}, found, 2);
        for (size_t i = 0; i < hits.size(); ++i) {
          ASSERT_EQ(found[i], hits[i].hit) << "ray " << i << " within " << distance;
          ++(hits[i].hit ? occluded : open);
        }
      }
    dag.rays(origins, directions, {}, hits);
    for (size_t i = 0; i < hits.size(); i += 97) {
      if (!hits[i].hit) continue;
      const double distance = hits[i].distance;
      for (const double limit : {std::nextafter(distance, 0), distance}) {
        uint8_t one = 2;
        dag.occluded({&origins[i], 1}, {&directions[i], 1}, {limit, 0}, {&one, 1});
        ASSERT_EQ(one, limit == distance) << "ray " << i;
        if (distance == 0) break;
      }
    }
  }
  EXPECT_GT(occluded, 10000u);
  EXPECT_GT(open, 10000u);
}

TEST_F(DagRays, OcclusionRefusesWrongArguments) {
  const Coordinates origin{0, 0, 0}, along_z{0, 0, 1}, zero{0, 0, 0};
  uint8_t occluded[2];
  const auto code_of = [&](const Coordinates& direction, const RayLimits& limits, size_t results) {
    return error_of([&] {
             dag_.occluded({&origin, 1}, {&direction, 1}, limits, {occluded, results});
           })
        .code();
  };
  EXPECT_EQ(code_of(zero, {}, 1), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of(along_z, {-1, 0}, 1), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of(along_z, {1, -1}, 1), ErrorCode::kInvalidInput);
  EXPECT_EQ(code_of(along_z, {}, 2), ErrorCode::kInvalidInput);
}

// Casts so many rays that they are divided into several batches. One thread and four threads find
// the same hits.
TEST_F(DagRays, ThreadsDoNotChangeTheHits) {
  std::vector<Coordinates> origins, directions;
  for (const Ray& ray : many_rays(16, 9))
    for (int i = 0; i < 3; ++i) {
      origins.push_back({ray.origin[0], ray.origin[1], ray.origin[2]});
      directions.push_back({ray.direction[0], ray.direction[1], ray.direction[2]});
    }
  std::vector<RayHit> one(origins.size()), four(origins.size());
  dag_.rays(origins, directions, {}, one);
  dag_.rays(origins, directions, {}, four, 4);
  size_t hits = 0;
  for (size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].hit, four[i].hit);
    ASSERT_EQ(one[i].distance, four[i].distance);
    ASSERT_EQ(one[i].cell, four[i].cell);
    hits += one[i].hit;
  }
  EXPECT_GT(hits, 0u);
  EXPECT_GT(origins.size(), 10000u);
}

}  // namespace
