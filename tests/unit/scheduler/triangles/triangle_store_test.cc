// Tests the guarantees that MemoryStore and DurableStore share, and additional guarantees of
// DurableStore.
#include "scheduler/triangles/triangle_store.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <memory>
#include <random>

#include "scheduler/triangles/durable_store.h"
#include "scheduler/triangles/memory_store.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

enum class Kind { kMemory, kDurable };

class TriangleStoreTest : public testing::TestWithParam<Kind> {
 protected:
  std::string spill_path() const { return folder_.file("spill"); }
  std::string durable_path() const { return folder_.file("durable"); }

  std::unique_ptr<TriangleStore> open_store(bool wide, MemoryBudget& share) const {
    if (GetParam() == Kind::kMemory)
      return std::make_unique<MemoryStore>(system_files(), spill_path(), wide, share);
    return std::make_unique<DurableStore>(system_files(), durable_path(), DurableStoreState{},
                                          spill_path(), wide, share);
  }
  static bool is_durable() { return GetParam() == Kind::kDurable; }

  TemporaryFolder folder_;
};

const Cube kHalves[2] = {{1, {0, 0, 0}}, {1, {1, 0, 0}}};

FixedTriangle random_triangle(std::mt19937_64& random, int64_t limit) {
  FixedTriangle t;
  for (auto& vertex : t.v)
    for (int64_t& u : vertex)
      u = (static_cast<int64_t>(random() % static_cast<uint64_t>(2 * limit)) - limit) | 1;
  return t;
}

std::vector<FixedTriangle> read_all(const TriangleStore& bins, BinId bin, size_t batch_size) {
  std::vector<FixedTriangle> all, batch(batch_size);
  const auto stream = bins.open(bin);
  while (const size_t n = stream->read(batch))
    all.insert(all.end(), batch.begin(), batch.begin() + static_cast<std::ptrdiff_t>(n));
  return all;
}

bool equal(const std::vector<FixedTriangle>& a, const std::vector<FixedTriangle>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const FixedTriangle& x, const FixedTriangle& y) {
                      return std::memcmp(&x, &y, sizeof x) == 0;
                    });
}

// A bin returns its triangles in the order in which they were added: from memory or from disk, with
// 32-bit or 64-bit ("wide") coordinates, in batches of any size, and again after a rewind.
TEST_P(TriangleStoreTest, ReturnsWhatWasStored) {
  for (const bool wide : {false, true})
    for (const uint64_t share_bytes : {uint64_t{0}, uint64_t{20000}, uint64_t{1} << 30}) {
      SCOPED_TRACE(testing::Message() << "wide " << wide << ", share " << share_bytes);
      MemoryBudget share(share_bytes);
      const auto store = open_store(wide, share);
      store->add_cube_bins(kHalves);
      const std::vector<BinId> ids = {kSceneBin, store->cube_bins()[0].bin,
                                      store->add_part(store->cube_bins()[0].bin),
                                      store->cube_bins()[1].bin};
      std::vector<FixedTriangle> expected[4];
      BinWriter writer(*store, ids, 1 << 16);
      std::mt19937_64 random(7);
      for (int i = 0; i < 5000; ++i) {
        const size_t target = random() % 3;  // the last bin remains empty
        expected[target].push_back(random_triangle(random, wide ? kCoordinateLimit : 1ll << 31));
        writer.append(target, expected[target].back());
      }
      writer.flush();
      for (size_t i = 0; i < ids.size(); ++i) {
        EXPECT_EQ(store->count(ids[i]), expected[i].size());
        for (const size_t batch : {size_t{1}, size_t{7}, size_t{4096}})
          EXPECT_TRUE(equal(read_all(*store, ids[i], batch), expected[i]));
      }
      EXPECT_EQ(store->file_bytes() > 0, is_durable() || share_bytes < (1 << 20));
      EXPECT_LE(share.peak(), share_bytes);
      const auto stream = store->open(ids[0]);
      std::vector<FixedTriangle> first(1), again(1);
      stream->read(first);
      stream->rewind();
      stream->read(again);
      EXPECT_TRUE(equal(first, again));
      for (const BinId id : {ids[0], ids[2], ids[1], ids[3]})
        if (store->drop(id)) store->release(id);
      EXPECT_EQ(share.used(), 0u);
    }
}

// drop() frees a bin of a MemoryStore. A DurableStore keeps the bin until the last release(). A
// part that was copied from a durable bin retains this bin until the part is released.
TEST_P(TriangleStoreTest, FreesABinWithItsLastReference) {
  MemoryBudget share(1 << 20);
  const auto store = open_store(false, share);
  store->add_cube_bins(kHalves);
  const BinId cube = store->cube_bins()[0].bin;
  BinWriter writer(*store, {cube}, 1000);
  writer.append(0, FixedTriangle{});
  writer.flush();
  ASSERT_EQ(store->count(cube), 1u);
  store->retain(cube);
  store->release(cube);
  EXPECT_EQ(store->count(cube), 1u);
  const BinId part = store->add_part(cube);
  BinWriter to_part(*store, {part}, 1000);
  to_part.append(0, FixedTriangle{});
  to_part.flush();
  EXPECT_EQ(store->drop(cube), is_durable());
  store->release(cube);
  EXPECT_EQ(store->count(cube), is_durable() ? 1u : 0u) << "the part retains a durable bin";
  EXPECT_EQ(store->count(part), 1u);
  EXPECT_EQ(store->drop(part), is_durable());
  EXPECT_EQ(store->count(part), 0u);
  store->release(part);
  EXPECT_EQ(store->count(cube), 0u);
  EXPECT_EQ(share.used(), 0u);
}

// A stream can begin at any triangle, inside a chunk or between two chunks.
TEST_P(TriangleStoreTest, StreamsBeginAnywhere) {
  MemoryBudget share(40000);
  const auto store = open_store(false, share);
  BinWriter writer(*store, {kSceneBin}, 4000);
  std::mt19937_64 random(9);
  std::vector<FixedTriangle> expected;
  for (int i = 0; i < 3000; ++i) {
    expected.push_back(random_triangle(random, 1000));
    writer.append(0, expected.back());
  }
  writer.flush();
  for (const uint64_t first : {0u, 1u, 110u, 111u, 112u, 2999u, 3000u}) {
    SCOPED_TRACE(first);
    const auto stream = store->open(kSceneBin, first);
    EXPECT_EQ(stream->count(), 3000 - first);
    for (int pass = 0; pass < 2; ++pass) {
      std::vector<FixedTriangle> tail(4000);
      tail.resize(stream->read(tail));
      EXPECT_TRUE(
          equal(tail, {expected.begin() + static_cast<std::ptrdiff_t>(first), expected.end()}));
      stream->rewind();
    }
  }
}

std::string name_of(const testing::TestParamInfo<Kind>& info) {
  return info.param == Kind::kMemory ? "Memory" : "Durable";
}
INSTANTIATE_TEST_SUITE_P(Stores, TriangleStoreTest, testing::Values(Kind::kMemory, Kind::kDurable),
                         name_of);

// A store that is opened with the state of a checkpoint has the bins of this checkpoint. It ignores
// triangles that were written later.
TEST(DurableStoreTest, OpensAtItsLastCheckpoint) {
  TemporaryFolder folder;
  MemoryBudget share(1 << 20);
  std::mt19937_64 random(8);
  std::vector<FixedTriangle> expected[2];
  DurableStoreState state;
  const auto open_store = [&] {
    return std::make_unique<DurableStore>(system_files(), folder.file("durable"), state,
                                          folder.file("spill"), false, share);
  };
  for (int run = 0; run < 3; ++run) {
    SCOPED_TRACE(run);
    const auto store = open_store();
    if (run == 0) store->add_cube_bins({kHalves, 1});
    ASSERT_EQ(store->cube_bins().size(), 1u);
    EXPECT_EQ(store->cube_bins()[0].cube, kHalves[0]);
    const std::vector<BinId> ids = {kSceneBin, store->cube_bins()[0].bin};
    for (size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(store->count(ids[i]), expected[i].size());
      EXPECT_TRUE(equal(read_all(*store, ids[i], 100), expected[i]));
    }
    BinWriter writer(*store, ids, 1 << 14);
    for (int link = 0; link < 3; ++link) {
      for (int i = 0; i < 700; ++i) {
        const size_t target = random() % 2;
        expected[target].push_back(random_triangle(random, 1ll << 31));
        writer.append(target, expected[target].back());
      }
      writer.flush();
      state = store->checkpoint();
    }
    store->file()->sync();
    // These triangles are written after the last checkpoint, so the next run does not see them.
    for (int i = 0; i < 500; ++i) writer.append(0, random_triangle(random, 1000));
    writer.flush();
    EXPECT_FALSE(std::filesystem::exists(folder.file("spill")));
  }
  state.cubes = {};
  EXPECT_THROW(open_store(), DamagedTriangles) << "a bin is missing";
}

}  // namespace
}  // namespace voxdag
