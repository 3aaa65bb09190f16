// Both methods of voxelization, by list and by tiles, give the oracle's bricks. Neither the number
// of triangles that are read together nor the size of the slices (pairs.h) affects the result.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "core/backend/parallel/space/host_space.h"
#include "core/backend/parallel/voxelize/tiles.h"
#include "core/backend/parallel/voxelize/voxel_list.h"
#include "tests/oracle/core_types.h"
#include "tests/oracle/scenes.h"
#include "tests/oracle/voxels.h"

namespace voxdag::parallel {
namespace {

using Bricks = std::map<uint64_t, uint64_t>;  // code -> mask

Bricks bricks_of(const oracle::Voxels& voxels) {
  Bricks out;
  for (uint32_t x = 0; x < static_cast<uint32_t>(voxels.edge()); ++x)
    for (uint32_t y = 0; y < static_cast<uint32_t>(voxels.edge()); ++y)
      for (uint32_t z = 0; z < static_cast<uint32_t>(voxels.edge()); ++z)
        if (voxels.at(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z))) {
          const uint64_t code = morton_encode(x, y, z);
          out[code >> 6] |= uint64_t{1} << (code & 63);
        }
  return out;
}

class Voxelize : public testing::Test {
 protected:
  // Merges the list, and returns its bricks by code. Checks that the codes increase, so that none
  // occurs twice.
  static Bricks merged(BrickList<HostSpace>& list) {
    list.merge();
    Bricks out;
    for (uint32_t i = 0; i < list.size(); ++i) {
      EXPECT_TRUE(i == 0 || list.codes()[i - 1] < list.codes()[i]);
      out[list.codes()[i]] = list.masks()[i];
    }
    return out;
  }

  MemoryBudget budget{uint64_t{1} << 28};
  CancelToken cancel;
  HostSpace space{budget, cancel, 2};
  const SubvolumeTask task{9, {2, {1, 3, 2}}, 64};  // 128 voxels
  const oracle::Region region = oracle::region_of(task.cube, task.grid_levels);
};

TEST_F(Voxelize, ListAndTilesGiveTheOraclesBricks) {
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    const auto scene = oracle::make_scene(kind, 6, region, 40);
    const Bricks truth = bricks_of(oracle::voxelize(scene, region));
    ASSERT_FALSE(truth.empty());
    oracle::VectorStream stream(oracle::fixed(scene), 7);
    BrickList<HostSpace> by_list(space, 15), by_tiles(space, 15);
    voxelize_by_list(space, task, stream, by_list);
    EXPECT_EQ(merged(by_list), truth);
    voxelize_by_tiles(space, task, stream, by_tiles);
    EXPECT_EQ(merged(by_tiles), truth);
  }
}

// A window is the size of a frame: a buffer for the pairs of one level (pairs.h). With tiny
// windows, the pairs of a frame are expanded in many slices, and voxels are packed into bricks many
// times, so that the brick list is merged and grows in between. The bricks remain the same.
TEST_F(Voxelize, TinyWindowsChangeNothing) {
  const auto scene = oracle::fixed(oracle::make_scene(oracle::SceneKind::kSoup, 2, region, 60));
  const uint32_t count = static_cast<uint32_t>(scene.size());
  Bricks first;
  for (const auto& [window, voxels] : {std::pair{1u << 16, 1u << 20}, {64u, 64u}, {100u, 333u}}) {
    SCOPED_TRACE(window);
    BrickList<HostSpace> bricks(space, 15);
    PairExpansion<HostSpace> pairs(space, task, 5, true, window);
    VoxelList<HostSpace> list(space, bricks, 21, voxels);
    for (uint32_t at = 0; at < count; at += 30)
      pairs.run(scene.data(), at, std::min(at + 30, count), list);
    list.flush();
    const Bricks got = merged(bricks);
    if (first.empty()) first = got;
    EXPECT_EQ(got, first);
  }
  EXPECT_GT(first.size(), 500u);
}

// merge() combines all bricks with the same code into one brick that has all their voxels, even if
// they were added in different parts.
TEST_F(Voxelize, BrickListMergesWhatComesAgain) {
  oracle::Random random(5);
  BrickList<HostSpace> list(space, 15);
  Bricks truth;
  for (int part = 0; part < 400; ++part) {
    const uint32_t count = static_cast<uint32_t>(random.between(1, 200));
    const uint32_t at = list.reserve(count);
    ASSERT_EQ(at, list.size());
    for (uint32_t i = at; i < at + count; ++i) {
      list.codes()[i] = static_cast<uint64_t>(random.between(0, part < 200 ? 3000 : 32767));
      list.masks()[i] = uint64_t{1} << random.between(0, 63);
      truth[list.codes()[i]] |= list.masks()[i];
    }
    list.commit(count, false);
  }
  EXPECT_EQ(merged(list), truth);
}

TEST(SelectBit, FindsTheBitOfARank) {
  oracle::Random random(6);
  for (int i = 0; i < 1000; ++i) {
    uint64_t mask = 0;
    for (int64_t bits = random.between(1, 64); bits > 0; --bits)
      mask |= uint64_t{1} << random.between(0, 63);
    uint32_t rank = 0;
    for (uint64_t left = mask; left != 0; left &= left - 1, ++rank)
      ASSERT_EQ(select_bit(mask, rank), lowest_bit(left)) << mask << " rank " << rank;
  }
}

}  // namespace
}  // namespace voxdag::parallel
