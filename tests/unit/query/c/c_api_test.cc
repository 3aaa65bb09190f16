// Compares the functions of voxdag.h with the C++ class, and checks their errors for bad arguments.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <thread>

#include "query/c/voxdag.h"
#include "tests/unit/core/format/test_files.h"
#include "voxdag/query.h"

namespace voxdag::query {
namespace {

const std::string kPath = VOXDAG_SOURCE_DIR "/tests/golden/floor_and_pillar.vdag";

class CApiTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(voxdag_open(kPath.c_str(), &file_), VOXDAG_OK) << voxdag_error();
  }
  void TearDown() override { voxdag_close(file_); }
  voxdag_region whole() const {
    const int64_t edge = dag_.resolution();
    return {{0, 0, 0}, {edge, edge, edge}};
  }

  const DagFile dag_{kPath};
  const uint32_t levels_ = dag_.grid_levels();
  voxdag_file* file_ = nullptr;
};

TEST_F(CApiTest, Facts) {
  voxdag_facts facts{};
  facts.struct_size = sizeof facts;
  ASSERT_EQ(voxdag_get_facts(file_, &facts), VOXDAG_OK);
  EXPECT_EQ(facts.grid_levels, levels_);
  EXPECT_EQ(facts.voxels, dag_.voxels());
  EXPECT_EQ(facts.dag_nodes, dag_.dag_nodes());
  EXPECT_EQ(facts.svo_nodes, dag_.svo_nodes());
  EXPECT_EQ(facts.bytes, dag_.file_bytes());
  EXPECT_EQ(facts.edge, dag_.edge());
  EXPECT_EQ(facts.origin[1], dag_.origin()[1]);
}

// A program that was compiled with a newer header passes structs with additional members. The
// library sets additional output members to 0, and refuses additional input members that are not 0.
// It also refuses a struct_size of 0 or SIZE_MAX.
TEST_F(CApiTest, StructsOfOtherSizes) {
  EXPECT_STREQ(voxdag_version(), VOXDAG_VERSION);
  voxdag_facts facts{};
  EXPECT_EQ(voxdag_get_facts(file_, &facts), VOXDAG_INVALID_INPUT);
  struct {
    voxdag_facts known{};
    uint64_t unknown = 7, behind = 7;
  } later;
  facts.struct_size = SIZE_MAX;  // as in a struct that was not initialized
  EXPECT_EQ(voxdag_get_facts(file_, &facts), VOXDAG_INVALID_INPUT);
  later.known.struct_size = sizeof(voxdag_facts) + 8;
  ASSERT_EQ(voxdag_get_facts(file_, &later.known), VOXDAG_OK);
  EXPECT_EQ(later.known.voxels, dag_.voxels());
  EXPECT_EQ(later.known.struct_size, sizeof(voxdag_facts) + 8);
  EXPECT_EQ(later.unknown, 0u);
  EXPECT_EQ(later.behind, 7u);

  const double edge = static_cast<double>(dag_.resolution());
  const voxdag_ray down{{edge / 2, edge + 1, edge / 2}, {0, -1, 0}};
  voxdag_hit hit;
  struct {
    voxdag_ray_limits known{sizeof(voxdag_ray_limits) + 8, INFINITY, 0};
    uint64_t unknown = 0;
  } limits;
  EXPECT_EQ(voxdag_cast_rays(file_, &down, 1, &limits.known, &hit), VOXDAG_OK) << voxdag_error();
  EXPECT_TRUE(std::isfinite(hit.distance));
  limits.known.max_distance = 0.5;
  EXPECT_EQ(voxdag_cast_rays(file_, &down, 1, &limits.known, &hit), VOXDAG_OK);
  EXPECT_FALSE(std::isfinite(hit.distance));
  limits.unknown = 1;
  EXPECT_EQ(voxdag_cast_rays(file_, &down, 1, &limits.known, &hit), VOXDAG_INVALID_INPUT);
  limits.known.struct_size = sizeof(size_t);
  EXPECT_EQ(voxdag_cast_rays(file_, &down, 1, &limits.known, &hit), VOXDAG_INVALID_INPUT);
}

TEST_F(CApiTest, CellsOfEveryLevel) {
  for (uint32_t levels = 0; levels <= levels_; ++levels) {
    SCOPED_TRACE(levels);
    const int64_t edge = int64_t{1} << levels;
    const voxdag_region region{{-1, 0, 0}, {edge, edge, edge + 1}};
    const size_t size = static_cast<size_t>((edge + 1) * edge * (edge + 1));
    std::vector<uint8_t> dense(size, 2), expected(size, 2);
    ASSERT_EQ(voxdag_dense(file_, levels, &region, dense.data()), VOXDAG_OK) << voxdag_error();
    dag_.box({levels, {{-1, 0, 0}, {edge, edge, edge + 1}}}, expected);
    EXPECT_EQ(dense, expected);
    uint64_t count = 0;
    ASSERT_EQ(voxdag_count(file_, levels, &region, &count), VOXDAG_OK);
    EXPECT_EQ(count, static_cast<uint64_t>(std::count(dense.begin(), dense.end(), 1)));
    EXPECT_GT(count, 0u);
    std::vector<Position> cells(count);
    const auto list = reinterpret_cast<int64_t(*)[3]>(cells.data());
    ASSERT_EQ(voxdag_list(file_, levels, &region, count, list), VOXDAG_OK);
    std::vector<uint8_t> set(count);
    ASSERT_EQ(voxdag_lookup(file_, levels, list, count, set.data()), VOXDAG_OK);
    EXPECT_EQ(set, std::vector<uint8_t>(count, 1));
    EXPECT_EQ(voxdag_list(file_, levels, &region, count - 1, list), VOXDAG_INVALID_INPUT);
    EXPECT_NE(std::string(voxdag_error()).find(std::to_string(count)), std::string::npos);
  }
}

TEST_F(CApiTest, Rays) {
  const double edge = static_cast<double>(dag_.resolution());
  std::vector<voxdag_ray> rays;
  for (int i = 0; i < 5000; ++i)
    rays.push_back(
        {{std::fmod(0.37 * i, edge), edge + 1, std::fmod(0.73 * i, edge)}, {0.01, -3, 0.02}});
  std::vector<voxdag_hit> hits(rays.size());
  ASSERT_EQ(voxdag_cast_rays(file_, rays.data(), rays.size(), nullptr, hits.data()), VOXDAG_OK);
  std::vector<uint8_t> occluded(rays.size(), 2);
  ASSERT_EQ(voxdag_occluded(file_, rays.data(), rays.size(), nullptr, occluded.data()), VOXDAG_OK);
  uint64_t found = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    RayHit hit;
    const Coordinates origin{rays[i].origin[0], rays[i].origin[1], rays[i].origin[2]};
    const Coordinates direction{rays[i].direction[0], rays[i].direction[1], rays[i].direction[2]};
    dag_.rays({&origin, 1}, {&direction, 1}, {}, {&hit, 1});
    ASSERT_EQ(std::isfinite(hits[i].distance), hit.hit);
    ASSERT_EQ(occluded[i], hit.hit);
    if (!hit.hit) {
      EXPECT_EQ(hits[i].voxel[0], -1);
      continue;
    }
    ++found;
    EXPECT_EQ(hits[i].distance, hit.distance);
    EXPECT_TRUE(std::equal(hit.cell.begin(), hit.cell.end(), hits[i].voxel));
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_EQ(hits[i].normal[axis], axis == hit.axis ? hit.sign : 0);
  }
  EXPECT_GT(found, 100u);
  // A message names the ray, also behind the first batch of 4096 rays.
  rays[4500].direction[0] = NAN;
  EXPECT_EQ(voxdag_occluded(file_, rays.data(), rays.size(), nullptr, occluded.data()),
            VOXDAG_INVALID_INPUT);
  const std::string error = voxdag_error();
  EXPECT_NE(error.find("rays[404] has the origin"), std::string::npos) << error;
  EXPECT_NE(error.find("rays[0] in this message is ray 4096"), std::string::npos) << error;
}

TEST_F(CApiTest, Nearest) {
  const int64_t from[2][3] = {{0, 0, 0}, {100, -7, 3}};
  int64_t nearest[2][3];
  double distances[2];
  ASSERT_EQ(voxdag_nearest(file_, from, 2, INFINITY, nearest, distances), VOXDAG_OK);
  for (int i = 0; i < 2; ++i) {
    Nearest expected;
    const Position point{from[i][0], from[i][1], from[i][2]};
    dag_.nearest({&point, 1}, levels_, INFINITY, {&expected, 1});
    EXPECT_TRUE(std::equal(expected.cell.begin(), expected.cell.end(), nearest[i]));
    EXPECT_EQ(distances[i] * distances[i], static_cast<double>(expected.squared_distance));
  }
  ASSERT_EQ(voxdag_nearest(file_, from + 1, 1, 0.5, nearest, nullptr), VOXDAG_OK);
  EXPECT_EQ(nearest[0][0], -1);
}

TEST_F(CApiTest, Refuses) {
  voxdag_file* other = file_;
  EXPECT_EQ(voxdag_open("/nowhere/x.vdag", &other), VOXDAG_NOT_FOUND);
  EXPECT_EQ(other, nullptr);
  EXPECT_NE(std::string(voxdag_error()).find("/nowhere/x.vdag"), std::string::npos);
  EXPECT_EQ(voxdag_open(VOXDAG_SOURCE_DIR "/README.md", &other), VOXDAG_CORRUPT);
  EXPECT_EQ(voxdag_open(nullptr, &other), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_open(kPath.c_str(), nullptr), VOXDAG_INVALID_INPUT);

  const voxdag_region region = whole();
  uint64_t count = 7;
  EXPECT_EQ(voxdag_count(nullptr, levels_, &region, &count), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_count(file_, levels_, nullptr, &count), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_count(file_, levels_ + 1, &region, &count), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(count, 7u);
  EXPECT_EQ(voxdag_lookup(file_, levels_, nullptr, 1, nullptr), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_lookup(file_, levels_, nullptr, 0, nullptr), VOXDAG_OK);
  const voxdag_region endless{{INT64_MIN, INT64_MIN, 0}, {INT64_MAX, INT64_MAX, INT64_MAX}};
  uint8_t cell;
  EXPECT_EQ(voxdag_dense(file_, levels_, &endless, &cell), VOXDAG_INVALID_INPUT);
  const voxdag_region flat{{0, 0, 0}, {INT64_MAX, INT64_MAX, 0}};
  EXPECT_EQ(voxdag_dense(file_, levels_, &flat, nullptr), VOXDAG_OK) << voxdag_error();
  const voxdag_ray still{{0, 0, 0}, {0, 0, 0}}, nowhere{{0, 0, 0}, {0, NAN, 1}};
  voxdag_hit hit;
  EXPECT_EQ(voxdag_cast_rays(file_, &still, 1, nullptr, &hit), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_cast_rays(file_, &nowhere, 1, nullptr, &hit), VOXDAG_INVALID_INPUT);
  uint8_t occluded = 0;
  EXPECT_EQ(voxdag_occluded(file_, &still, 1, nullptr, &occluded), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_occluded(file_, &still, 1, nullptr, nullptr), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_occluded(nullptr, &still, 1, nullptr, &occluded), VOXDAG_INVALID_INPUT);
  voxdag_close(nullptr);
}

// A file in memory gives the same answers as the file on disk, at an aligned and at an odd address.
TEST_F(CApiTest, OpensAFileInMemory) {
  const std::string bytes = read_bytes(kPath);
  std::vector<uint64_t> words(bytes.size() / 8 + 2);
  for (const size_t offset : {0, 1}) {
    char* const data = reinterpret_cast<char*>(words.data()) + offset;
    std::memcpy(data, bytes.data(), bytes.size());
    voxdag_file* in_memory = nullptr;
    ASSERT_EQ(voxdag_open_memory(data, bytes.size(), &in_memory), VOXDAG_OK) << voxdag_error();
    voxdag_facts facts{};
    facts.struct_size = sizeof facts;
    ASSERT_EQ(voxdag_get_facts(in_memory, &facts), VOXDAG_OK);
    EXPECT_EQ(facts.voxels, dag_.voxels());
    const voxdag_region region = whole();
    uint64_t count = 0;
    ASSERT_EQ(voxdag_count(in_memory, levels_, &region, &count), VOXDAG_OK);
    EXPECT_EQ(count, dag_.voxels());
    voxdag_close(in_memory);
    EXPECT_EQ(voxdag_open_memory(data, bytes.size() - 1, &in_memory), VOXDAG_CORRUPT);
    EXPECT_EQ(in_memory, nullptr);
    EXPECT_TRUE(std::string(voxdag_error()).starts_with("memory: ")) << voxdag_error();
  }
  voxdag_file* none = nullptr;
  EXPECT_EQ(voxdag_open_memory(bytes.data(), 0, &none), VOXDAG_CORRUPT);
  EXPECT_EQ(voxdag_open_memory(nullptr, 8, &none), VOXDAG_INVALID_INPUT);
}

// A mapped file and a file in memory give the same results for many lookups. For so many lookups,
// DagFile makes a table of the top cells, and requests huge pages for the mapped file.
TEST(DagFileInMemory, AnswersManyLookups) {
  const DagFile mapped(kPath);
  const std::string bytes = read_bytes(kPath);
  const DagFile in_memory(bytes.data(), bytes.size());
  std::vector<Position> points(40000);
  for (size_t i = 0; i < points.size(); ++i)
    for (size_t axis = 0; axis < 3; ++axis)
      points[i][axis] = static_cast<int64_t>(i * (7 + 6 * axis)) % mapped.resolution();
  std::vector<uint8_t> expected(points.size()), found(points.size());
  mapped.lookup(points, mapped.grid_levels(), expected);
  in_memory.lookup(points, mapped.grid_levels(), found);
  EXPECT_EQ(found, expected);
}

TEST_F(CApiTest, ErrorsBelongToTheirThread) {
  voxdag_file* none = nullptr;
  EXPECT_EQ(voxdag_open("/nowhere/a.vdag", &none), VOXDAG_NOT_FOUND);
  std::thread([&] {
    EXPECT_STREQ(voxdag_error(), "");
    EXPECT_EQ(voxdag_open("/nowhere/b.vdag", &none), VOXDAG_NOT_FOUND);
  }).join();
  EXPECT_NE(std::string(voxdag_error()).find("a.vdag"), std::string::npos);
}

}  // namespace
}  // namespace voxdag::query
