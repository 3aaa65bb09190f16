#include "scheduler/stages/plan/pilot_triangles.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "scheduler/triangles/memory_store.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

constexpr uint32_t kShift = 6;

// Stores small triangles, row by row. Many of them become equal when they are snapped to the
// coarser grid of the pilot.
void fill(MemoryStore& store, int rows) {
  std::mt19937 random(7);
  BinWriter writer(store, {kSceneBin}, 1 << 20);
  for (int64_t y = 0; y < rows; ++y)
    for (int64_t x = 0; x < 1000; ++x) {
      const auto near = [&](int64_t at) {
        return (8 * at + static_cast<int64_t>(random() % 16)) | 1;
      };
      FixedTriangle triangle{};
      for (auto& vertex : triangle.v) {
        vertex[0] = near(x);
        vertex[1] = near(y);
        vertex[2] = near(0);
      }
      writer.append(0, triangle);
    }
  writer.flush();
}

using Key = std::array<int64_t, 9>;

std::multiset<Key> read_all(TriangleStream& stream, uint32_t shift) {
  std::multiset<Key> keys;
  std::vector<FixedTriangle> batch(100);
  while (const size_t n = stream.read(batch))
    for (size_t i = 0; i < n; ++i) {
      Key key{};
      for (size_t u = 0; u < 9; ++u) key[u] = (batch[i].v[u / 3][u % 3] >> shift) | 1;
      keys.insert(key);
    }
  return keys;
}

class PilotTrianglesTest : public testing::Test {
 protected:
  PilotTrianglesTest() { fill(store_, 200); }
  PilotTriangles thin(uint32_t shift, MemoryBudget& budget, unsigned threads) {
    return {store_, shift, false, budget, {{system_files(), progress_, cancel_}, threads, budget_}};
  }
  const TemporaryFolder folder_;
  NoProgress progress_;
  CancelToken cancel_;
  MemoryBudget budget_{uint64_t{256} << 20};
  MemoryStore store_{system_files(), folder_.file("spill"), false, budget_};
};

// PilotTriangles keeps every distinct triangle, and removes most duplicates.
TEST_F(PilotTrianglesTest, EqualOnesNearEachOtherAreThereOnce) {
  const auto all = read_all(*store_.open(kSceneBin), kShift);
  const std::set<Key> distinct(all.begin(), all.end());
  for (const unsigned threads : {1u, 3u}) {
    MemoryBudget share(uint64_t{64} << 20, &budget_);
    const PilotTriangles thinned = thin(kShift, share, threads);
    ASSERT_TRUE(thinned.is_complete());
    const auto left = read_all(*thinned.open(0), 0);
    EXPECT_EQ(std::set<Key>(left.begin(), left.end()), distinct);
    EXPECT_LT(left.size(), all.size() / 2);
  }
}

TEST_F(PilotTrianglesTest, ACoarserGridSeesWhatTheSceneWouldGive) {
  MemoryBudget share(uint64_t{64} << 20, &budget_);
  const PilotTriangles thinned = thin(kShift, share, 2);
  const auto coarse = read_all(*thinned.open(2), 0);
  const auto all = read_all(*store_.open(kSceneBin), kShift + 2);
  EXPECT_EQ(std::set<Key>(coarse.begin(), coarse.end()), std::set<Key>(all.begin(), all.end()));
}

TEST_F(PilotTrianglesTest, WithoutMemoryForThemItIsIncomplete) {
  MemoryBudget share(uint64_t{8} << 20, &budget_);
  {
    const PilotTriangles thinned = thin(0, share, 2);
    EXPECT_FALSE(thinned.is_complete());
  }
  EXPECT_EQ(share.used(), 0u);
}

}  // namespace
}  // namespace voxdag
