#include <gtest/gtest.h>
#include <sys/stat.h>

#include "core/format/global/voxdag_reader.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

using voxdag_reader::Access;
using voxdag_reader::File;

class ReaderTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  const std::string path_ = folder_.file("scene.vdag");
};

// A visitor for walks. Collects the voxels that the walk visits, and counts the visited nodes and
// bricks.
struct Collector {
  explicit Collector(int edge) : voxels(edge) {}
  bool node(uint32_t, int64_t, int64_t, int64_t, uint64_t) {
    ++nodes;
    return true;
  }
  void brick(int64_t x, int64_t y, int64_t z, uint64_t mask, uint64_t) {
    ++nodes;
    for (int i = 0; i < 64; ++i)
      if (mask >> i & 1)
        voxels.set(static_cast<int>(x) + ((i >> 4 & 2) | (i >> 2 & 1)),
                   static_cast<int>(y) + ((i >> 3 & 2) | (i >> 1 & 1)),
                   static_cast<int>(z) + ((i >> 2 & 2) | (i & 1)));
  }
  oracle::Voxels voxels;
  uint64_t nodes = 0;
};

// Lookups and walks find exactly the written voxels, both in a mapped file and in a file that is
// read.
TEST_F(ReaderTest, QueriesAndWalksGiveTheVoxels) {
  for (const int edge : {4, 8, 16, 64}) {
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE("edge " + std::to_string(edge) + ", seed " + std::to_string(seed));
      const oracle::Voxels voxels = random_voxels(seed, edge);
      write_global(path_, voxels);
      const File file(path_, seed == 1 ? Access::kRead : Access::kMap);
      EXPECT_EQ(file.resolution(), edge);
      EXPECT_EQ(file.voxels(), voxels.count());
      Collector collector(edge);
      file.walk(collector);
      EXPECT_EQ(collector.voxels, voxels);
      EXPECT_EQ(collector.nodes, file.svo_nodes());
      for (int x = 0; x < edge; ++x)
        for (int y = 0; y < edge; ++y)
          for (int z = 0; z < edge; ++z)
            ASSERT_EQ(file.voxel(x, y, z), voxels.at(x, y, z)) << x << ' ' << y << ' ' << z;
      EXPECT_FALSE(file.voxel(-1, 0, 0) || file.voxel(0, edge, 0) || file.voxel(0, 0, edge));
      file.verify_checksums();
    }
  }
}

TEST_F(ReaderTest, TellsTheGrid) {
  write_global(path_, random_voxels(1, 32), 16);
  const File file(path_);
  const Grid grid = grid_of(32);
  for (size_t axis = 0; axis < 3; ++axis) EXPECT_EQ(file.origin()[axis], grid.origin[axis]);
  EXPECT_EQ(file.edge(), grid.edge);
  EXPECT_EQ(file.hash_bits(), 16u);
  EXPECT_EQ(file.brick_level(), 3u);
}

// If a visitor returns false for a node, the walk skips the node's descendants.
TEST_F(ReaderTest, WalksArePruned) {
  oracle::Voxels voxels(16);
  voxels.set(0, 0, 0);
  voxels.set(15, 15, 15);
  write_global(path_, voxels);
  struct {
    bool node(uint32_t level, int64_t x, int64_t, int64_t, uint64_t) {
      return level == 0 || x >= 8;
    }
    void brick(int64_t x, int64_t y, int64_t z, uint64_t mask, uint64_t) {
      ++bricks;
      EXPECT_EQ(x, 12);
      EXPECT_EQ(y, 12);
      EXPECT_EQ(z, 12);
      EXPECT_EQ(mask, uint64_t{1} << 63);
    }
    int bricks = 0;
  } visitor;
  File(path_).walk(visitor);
  EXPECT_EQ(visitor.bricks, 1);
}

TEST_F(ReaderTest, EmptySceneHasNoVoxels) {
  write_global(path_, oracle::Voxels(1 << 5));
  const File file(path_);
  EXPECT_TRUE(file.empty());
  EXPECT_FALSE(file.voxel(0, 0, 0));
  Collector collector(32);
  file.walk(collector);
  EXPECT_EQ(collector.nodes, 0u);
  file.verify_checksums();
}

// A pipe without a writer is refused immediately.
TEST_F(ReaderTest, APipeIsRefused) {
  const std::string pipe = folder_.file("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  try {
    voxdag_reader::File file(pipe);
    FAIL() << "a pipe is no global file";
  } catch (const voxdag_reader::Error& error) {
    EXPECT_NE(std::string(error.what()).find("is not a regular file"), std::string::npos);
  }
}

// Each kind of unreadable file gives a different problem: the file is missing, is not a voxdag
// file, has a newer format version, or is damaged.
TEST_F(ReaderTest, ProblemsAreReported) {
  using voxdag_reader::Problem;
  const auto problem = [&] {
    try {
      File file(path_);
    } catch (const voxdag_reader::Error& error) {
      return error.problem();
    }
    ADD_FAILURE() << "opened";
    return Problem::kIo;
  };
  EXPECT_EQ(problem(), Problem::kNotFound);
  write_bytes(path_, "");
  EXPECT_EQ(problem(), Problem::kCorrupt);
  write_bytes(path_, ByteString(10000, 'x'));
  EXPECT_EQ(problem(), Problem::kCorrupt);
  write_global(path_, random_voxels(1, 16));
  ByteString bytes = read_bytes(path_);
  bytes[8] = 3;
  write_bytes(path_, bytes);
  EXPECT_EQ(problem(), Problem::kUnsupportedVersion);
  EXPECT_THROW(File(folder_.path()), voxdag_reader::Error);
}

}  // namespace
}  // namespace voxdag
