// A dilated or eroded file has the bytes of the file that the oracle makes from the dilated or
// eroded voxels.
#include "query/morphology/morphology.h"

#include "query/morphology/steps.h"
#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

// Returns the voxels dilated or eroded along one axis, and then along the next two.
oracle::Voxels changed_voxels(oracle::Voxels voxels, const Morphology& morphology) {
  const auto distance = static_cast<int>(morphology.voxels);
  const int edge = voxels.edge();
  for (int axis = 0; axis < 3; ++axis) {
    oracle::Voxels changed(edge);
    for (int x = 0; x < edge; ++x)
      for (int y = 0; y < edge; ++y)
        for (int z = 0; z < edge; ++z) {
          bool any = false, all = true;
          for (int t = -distance; t <= distance; ++t) {
            int at[3] = {x, y, z};
            at[axis] += t;
            const bool is_inside = at[axis] >= 0 && at[axis] < edge;
            const bool is_set =
                is_inside ? voxels.at(at[0], at[1], at[2]) : morphology.is_outside_set;
            any = any || is_set;
            all = all && is_set;
          }
          if (morphology.is_erosion ? all : any) changed.set(x, y, z);
        }
    voxels = changed;
  }
  return voxels;
}

class MorphologyTest : public Combine {
 protected:
  CombineReport change(const Morphology& morphology, const CombineSpec& spec) {
    const auto file = open_global_file(path("a"));
    return change_by_cube(*file, morphology, spec, system_files(), warnings_, never_);
  }
  void expect_changed(const oracle::Voxels& a, bool is_erosion, int distance,
                      uint64_t list_bytes = ~uint64_t{0}) {
    write_global(path("a"), a);
    CombineSpec to = spec(Operation::kUnion, "c");
    to.list_bytes = list_bytes;
    for (const bool is_outside_set : {false, true}) {
      const Morphology morphology{is_erosion, static_cast<uint64_t>(distance), is_outside_set};
      if (is_outside_set && !is_erosion) continue;
      SCOPED_TRACE((is_erosion ? "erode " : "dilate ") + std::to_string(distance) +
                   (is_outside_set ? ", outside set" : ""));
      const oracle::Voxels expected = changed_voxels(a, morphology);
      write_global(path("expected"), expected);
      const CombineReport report = change(morphology, to);
      EXPECT_TRUE(bytes("c") == bytes("expected"));
      EXPECT_EQ(report.voxels, expected.count());
      const auto written = open_global_file(path("c"));
      EXPECT_EQ(report.svo_nodes, written->svo_nodes());
      EXPECT_EQ(report.dag_nodes, written->dag_nodes());
    }
  }
};

// For every distance: the windows have at most 4 voxels, the jumps leave no gaps, and both halves
// reach the distance.
TEST(MorphologySteps, ReachTheDistance) {
  for (uint64_t distance = 1; distance <= 5000; ++distance) {
    const std::vector<MorphologyStep> steps = morphology_steps(true, false, distance);
    for (const bool is_upward : {false, true}) {
      uint64_t reach = 0;
      for (const MorphologyStep& step : steps) {
        if (step.is_upward != is_upward) continue;
        ASSERT_TRUE(step.is_erosion);
        ASSERT_LE(step.distance, step.is_window ? kMaxWindow : reach + 1);
        if (!step.is_window) {
          ASSERT_TRUE(std::has_single_bit(step.distance) && step.distance >= 4);
        }
        reach += step.distance;
      }
      ASSERT_EQ(reach, distance);
    }
    ASSERT_LE(steps.size(), 4u + 4 * std::bit_width(distance));
  }
}

TEST_F(MorphologyTest, EqualsTheOracle) {
  for (const int distance : {1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 16, 29, 63, 64, 1000}) {
    oracle::Voxels few(64);
    few.set(0, 0, 0);
    few.set(63, 31, 17);
    fill(few, {20, 21, 22}, {44, 50, 61});
    expect_changed(few, false, distance);
    expect_changed(few, true, distance);
    expect_changed(random_voxels(static_cast<uint64_t>(distance), 32), false, distance);
  }
}

TEST_F(MorphologyTest, DenseVoxels) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    oracle::Random random(seed);
    oracle::Voxels dense(32);
    const auto rarity = int64_t{1} << (2 * seed);
    for (int x = 0; x < 32; ++x)
      for (int y = 0; y < 32; ++y)
        for (int z = 0; z < 32; ++z)
          if (random.between(0, rarity) != 0) dense.set(x, y, z);
    for (const int distance : {1, 2, 4, 5, 9}) expect_changed(dense, true, distance);
    expect_changed(dense, false, 1);
  }
}

TEST_F(MorphologyTest, SmallAndFullGrids) {
  for (const int edge : {4, 8, 16}) {
    oracle::Voxels full(edge), corner(edge);
    fill(full, {0, 0, 0}, {edge, edge, edge});
    corner.set(edge - 1, 0, edge - 1);
    for (const int distance : {1, 3, 4, 7, 20})
      for (const bool is_erosion : {false, true}) {
        expect_changed(full, is_erosion, distance);
        expect_changed(corner, is_erosion, distance);
        expect_changed(oracle::Voxels(edge), is_erosion, distance);
      }
  }
}

TEST_F(MorphologyTest, LittleMemory) {
  oracle::Voxels a = random_voxels(25, 64);
  fill(a, {9, 10, 11}, {40, 30, 35});
  for (const int distance : {1, 6, 8}) {
    expect_changed(a, false, distance, 256);
    expect_changed(a, true, distance, 256);
  }
}

TEST_F(MorphologyTest, LeavesNoFilesAndRefusesItsInput) {
  write_global(path("a"), random_voxels(3, 32));
  change({false, 9}, spec(Operation::kUnion, "c"));
  expect_files({"a", "c"});
  const Error error = error_of([&] { change({false, 1}, spec(Operation::kUnion, "a")); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  CombineSpec keep = spec(Operation::kUnion, "c");
  keep.replace = false;
  EXPECT_EQ(error_of([&] { change({false, 1}, keep); }).code(), ErrorCode::kInvalidInput);
  CancelToken canceled;
  canceled.cancel();
  const auto file = open_global_file(path("a"));
  EXPECT_EQ(error_of([&] {
              change_by_cube(*file, {true, 2}, spec(Operation::kUnion, "d"), system_files(),
                             warnings_, canceled);
            }).code(),
            ErrorCode::kCanceled);
  expect_files({"a", "c"});
}

TEST_F(MorphologyTest, Damage) {
  write_global(path("a"), random_voxels(4, 64));
  damage_each_level("a", [&] {
    const Error error = error_of([&] { change({false, 3}, spec(Operation::kUnion, "c")); });
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
  });
  expect_files({"a"});
}

}  // namespace
}  // namespace voxdag::query
