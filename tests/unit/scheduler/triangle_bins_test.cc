#include "scheduler/triangles/triangle_bins.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <random>

namespace voxdag {
namespace {

class TriangleBinsTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "voxdag-bins-" + std::to_string(getpid());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string spill_path() const { return folder_ + "/spill"; }

  std::string folder_;
};

FixedTriangle random_triangle(std::mt19937_64& random, int64_t limit) {
  FixedTriangle t;
  for (auto& vertex : t.v)
    for (int64_t& u : vertex)
      u = (static_cast<int64_t>(random() % static_cast<uint64_t>(2 * limit)) - limit) | 1;
  return t;
}

std::vector<FixedTriangle> read_all(const TriangleBins& bins, BinId bin, size_t batch_size) {
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

// What goes into a bin comes out of it, in order, whether it stayed in memory or was spilled, with
// narrow and with wide records, read in batches of any size and again after a rewind.
TEST_F(TriangleBinsTest, GivesBackWhatItTook) {
  for (const bool wide : {false, true})
    for (const uint64_t share_bytes : {uint64_t{0}, uint64_t{20000}, uint64_t{1} << 30}) {
      SCOPED_TRACE(testing::Message() << "wide " << wide << ", share " << share_bytes);
      MemoryBudget share(share_bytes);
      TriangleBins bins(system_files(), spill_path(), wide, share);
      const std::vector<BinId> ids = {bins.add_bin(), bins.add_bin(), bins.add_bin()};
      std::vector<FixedTriangle> expected[3];
      BinWriter writer(bins, ids, 1 << 16);
      std::mt19937_64 random(7);
      for (int i = 0; i < 5000; ++i) {
        const size_t target = random() % 2;  // the third stays empty
        expected[target].push_back(random_triangle(random, wide ? kCoordinateLimit : 1ll << 31));
        writer.append(target, expected[target].back());
      }
      writer.flush();
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(bins.count(ids[i]), expected[i].size());
        for (const size_t batch : {size_t{1}, size_t{7}, size_t{4096}})
          EXPECT_TRUE(equal(read_all(bins, ids[i], batch), expected[i]));
      }
      EXPECT_EQ(bins.spilled_bytes() > 0, share_bytes < (1 << 20));
      EXPECT_LE(share.peak(), share_bytes);
      const auto stream = bins.open(ids[0]);
      std::vector<FixedTriangle> first(1), again(1);
      stream->read(first);
      stream->rewind();
      stream->read(again);
      EXPECT_TRUE(equal(first, again));
      for (const BinId id : ids) bins.drop(id);
      EXPECT_EQ(share.used(), 0u);
    }
}

// Kept bins are found again by another process from the end of the file and the last link of the
// chain alone, whatever was written after that; the last who needs one gives its space back.
TEST_F(TriangleBinsTest, KeptBinsAreFoundAgain) {
  MemoryBudget share(1 << 20);
  std::mt19937_64 random(8);
  std::vector<FixedTriangle> expected[2];
  Extent last;
  uint64_t end = 0;
  for (int run = 0; run < 3; ++run) {
    SCOPED_TRACE(run);
    TriangleBins bins(system_files(), spill_path(), false, share);
    bins.keep_in(std::make_unique<TriangleFile>(system_files(), folder_ + "/kept", end));
    const std::vector<BinId> ids = {bins.add_kept_bin(), bins.add_kept_bin()};
    bins.read_chain(last);
    for (size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(bins.count(ids[i]), expected[i].size());
      EXPECT_TRUE(equal(read_all(bins, ids[i], 100), expected[i]));
    }
    BinWriter writer(bins, ids, 1 << 14);
    for (int link = 0; link < 3; ++link) {
      for (int i = 0; i < 700; ++i) {
        const size_t target = random() % 2;
        expected[target].push_back(random_triangle(random, 1ll << 31));
        writer.append(target, expected[target].back());
      }
      writer.flush();
      last = bins.write_chain();
    }
    bins.kept_file()->sync();
    end = bins.kept_file()->end();
    // Not named by any link: as if it had never been.
    for (int i = 0; i < 500; ++i) writer.append(0, random_triangle(random, 1000));
    writer.flush();
    EXPECT_FALSE(std::filesystem::exists(spill_path()));
  }
  const auto reopened = [&](int bin_count) {
    auto bins = std::make_unique<TriangleBins>(system_files(), spill_path(), false, share);
    bins->keep_in(std::make_unique<TriangleFile>(system_files(), folder_ + "/kept", end));
    for (int i = 0; i < bin_count; ++i) bins->add_kept_bin();
    return bins;
  };
  EXPECT_THROW(reopened(1)->read_chain(last), DamagedTriangles) << "a bin is missing";
  const auto bins = reopened(2);
  bins->read_chain(last);
  bins->hold(0, 2);
  bins->drop(0);
  bins->release(0);
  EXPECT_EQ(bins->count(0), expected[0].size());
  bins->release(0);
  EXPECT_EQ(bins->count(0), 0u);
}

// A stream may begin at any triangle, within a chunk or between two.
TEST_F(TriangleBinsTest, StreamsBeginAnywhere) {
  MemoryBudget share(40000);
  TriangleBins bins(system_files(), spill_path(), false, share);
  const BinId bin = bins.add_bin();
  BinWriter writer(bins, {bin}, 4000);
  std::mt19937_64 random(9);
  std::vector<FixedTriangle> expected;
  for (int i = 0; i < 3000; ++i) {
    expected.push_back(random_triangle(random, 1000));
    writer.append(0, expected.back());
  }
  writer.flush();
  for (const uint64_t first : {0u, 1u, 110u, 111u, 112u, 2999u, 3000u}) {
    SCOPED_TRACE(first);
    const auto stream = bins.open(bin, first);
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

}  // namespace
}  // namespace voxdag
