#include "core/format/artifact/artifact_copy.h"

#include <gtest/gtest.h>

#include "tests/oracle/core_types.h"
#include "tests/unit/core/format/test_artifacts.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

// Copies a sub-DAG from a cache entry to another cube. The sub-DAG, of 32^3 voxels in a grid of
// 2^10 voxels per edge, is written as an artifact, and this artifact as a cache entry.
class ArtifactCopyTest : public testing::Test {
 protected:
  ArtifactCopyTest() {
    SegmentWriter segment(system_files(), folder_.path(), 0, budget_);
    const ArtifactRoot root{{5, {7, 0, 31}}, 0, dag_.root_hash, dag_.voxels, dag_.svo_nodes};
    // The segment begins with another artifact, so that offsets in the segment differ from offsets
    // in the entry.
    write_artifact(segment, random_rows(1, 50, 10, 1, 64), 10, 64);
    const ArtifactRef ref =
        write_artifact(segment, oracle::as_sub_dag(dag_, 10), 10, 64, {&root, 1});
    write_cache_entry(system_files(), entry_path_, entry_path_ + ".partial", kKey,
                      *system_files().open_read(segment_path(folder_.path(), 0)), ref);
  }
  static constexpr const char* kKey = "key";
  // Reads the entry and copies its artifact for `cube` of a grid of 2^14 voxels per edge.
  ArtifactReader copy(const Cube& cube) {
    const CacheEntry entry = read_cache_entry(system_files(), entry_path_, kKey);
    SegmentWriter segment(system_files(), folder_.path(), 1, budget_);
    const ArtifactRef ref = copy_artifact(*entry.file, entry.ref, cube, 14, segment);
    segment.flush();
    return ArtifactReader(system_files().open_read(segment_path(folder_.path(), 1)), ref);
  }

  TemporaryFolder folder_;
  MemoryBudget budget_{uint64_t{16} << 20};
  const oracle::Dag dag_ = oracle::build_dag(random_voxels(4, 32), 64);
  const std::string entry_path_ = folder_.file("entry.vdart");
};

// The copy has the same rows at another position of another grid. Its roots and counts are
// unchanged.
TEST_F(ArtifactCopyTest, MovesASubDagToAnotherCube) {
  const Cube cube{9, {1, 2, 3}};
  const ArtifactReader reader = copy(cube);
  EXPECT_EQ(read_artifact(reader), oracle::as_sub_dag(dag_, 14));
  ASSERT_EQ(reader.roots().size(), 1u);
  EXPECT_EQ(reader.roots()[0].cube, cube);
  EXPECT_EQ(reader.roots()[0].voxels, dag_.voxels);
  const CacheEntry entry = read_cache_entry(system_files(), entry_path_, kKey);
  EXPECT_EQ(entry.root.svo_nodes, dag_.svo_nodes);
  EXPECT_EQ(entry.dag_nodes, dag_.dag_nodes);
}

TEST_F(ArtifactCopyTest, CubesOfAnotherSizeAreRefused) {
  EXPECT_EQ(error_of([&] { copy({8, {1, 2, 3}}); }).code(), ErrorCode::kCorrupt);
}

// A cache entry is refused if its key differs from the requested key, as after its file was
// renamed.
TEST_F(ArtifactCopyTest, EntriesOfOtherKeysAreRefused) {
  EXPECT_EQ(error_of([&] { read_cache_entry(system_files(), entry_path_, "other"); }).code(),
            ErrorCode::kCorrupt);
}

// The entry of a solid also has the counts of its interior. An entry of a shell is refused if an
// entry of a solid is requested.
TEST_F(ArtifactCopyTest, EntriesOfSolidsHaveTheirCounts) {
  const CacheEntry shell = read_cache_entry(system_files(), entry_path_, kKey);
  EXPECT_EQ(error_of([&] { read_cache_entry(system_files(), entry_path_, kKey, true); }).code(),
            ErrorCode::kCorrupt);
  const std::string path = folder_.file("solid.vdart");
  write_cache_entry(system_files(), path, path + ".partial", kKey, *shell.file, shell.ref,
                    SolidCounts{7, 3});
  const CacheEntry solid = read_cache_entry(system_files(), path, kKey, true);
  EXPECT_EQ(solid.solid.interior, 7u);
  EXPECT_EQ(solid.solid.disputed, 3u);
  EXPECT_EQ(solid.root.voxels, dag_.voxels);
  EXPECT_EQ(error_of([&] { read_cache_entry(system_files(), path, kKey); }).code(),
            ErrorCode::kCorrupt);
}

// Cache entries are not synced, so after a power cut they can contain anything. Reading an entry
// with one flipped bit, or a truncated entry, throws Error.
TEST_F(ArtifactCopyTest, EveryBitFlipAndTruncationIsCaught) {
  const ByteString bytes = read_bytes(entry_path_);
  const auto file = system_files().open_write(entry_path_);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const char flipped = static_cast<char>(bytes[bit / 8] ^ 1 << bit % 8);
    file->write_at(bit / 8, std::as_bytes(std::span(&flipped, 1)));
    EXPECT_THROW(copy({9, {1, 2, 3}}), Error) << "bit " << bit;
    file->write_at(bit / 8, std::as_bytes(std::span(&bytes[bit / 8], 1)));
  }
  for (size_t size = bytes.size(); size-- > 0;) {
    std::filesystem::resize_file(entry_path_, size);
    EXPECT_THROW(copy({9, {1, 2, 3}}), Error) << size << " bytes";
  }
}

}  // namespace
}  // namespace voxdag
