// Tests that a merge refuses damaged and unsuitable artifacts, and leaves no files behind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "merge/output/level_output.h"
#include "tests/unit/merge/merge_harness.h"

namespace voxdag {
namespace {

class MergeErrors : public testing::Test {
 protected:
  MergeErrors() : harness_(6, 64) {
    harness_.add(mixed_voxels(1, 64), equal_cubes(1));
    std::filesystem::create_directory(harness_.scratch_folder());
  }

  // Expects that a merge throws an Error with this code, leaves the scratch folder empty, and
  // leaves no partial file. Returns the Error.
  Error merge_fails(ErrorCode code, const MergeOptions& options = {}) {
    try {
      harness_.merge(options);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.message();
      EXPECT_TRUE(harness_.has_no_scratch());
      EXPECT_FALSE(std::filesystem::exists(harness_.folder().file("merged.vdag.partial")));
      return error;
    }
    ADD_FAILURE() << "expected an Error";
    return Error(code, "");
  }

  MergeHarness harness_;
};

// A flipped bit in the data or the index of any artifact is detected, with any number of threads.
TEST_F(MergeErrors, DamagedArtifactsAreCorrupt) {
  const std::string path = segment_path(harness_.folder().path(), 7);
  for (const ArtifactRef& ref : harness_.artifacts())
    for (const uint64_t at : {ref.offset + 9, ref.index_offset - 1, ref.index_offset + 20}) {
      std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
      const auto flip = [&] {
        file.seekg(static_cast<std::streamoff>(at));
        const char byte = static_cast<char>(file.peek() ^ 16);
        file.seekp(static_cast<std::streamoff>(at));
        file.put(byte);
        file.flush();
      };
      flip();
      for (unsigned threads = 1; threads <= 3; ++threads)
        merge_fails(ErrorCode::kCorrupt, {.threads = threads});
      flip();
    }
  EXPECT_GT(harness_.merge().report.dag_nodes, 0u);
}

TEST_F(MergeErrors, OverlappingSubvolumesAreCorrupt) {
  const oracle::Dag brick = oracle::build_dag(mixed_voxels(2, 4), 64);
  harness_.add(brick, Cube{4, {3, 3, 3}});
  EXPECT_THAT(merge_fails(ErrorCode::kCorrupt).message(), testing::HasSubstr("overlap"));
}

TEST_F(MergeErrors, AWholeGridBesideAPartOfItIsCorrupt) {
  harness_.add(oracle::build_dag(mixed_voxels(3, 64), 64), Cube{});
  EXPECT_THAT(merge_fails(ErrorCode::kCorrupt).message(), testing::HasSubstr("overlap"));
}

TEST_F(MergeErrors, ArtifactsOfOtherHashBitsAreCorrupt) {
  MergeHarness other(6, 32);
  other.add(mixed_voxels(1, 64), equal_cubes(1));
  std::filesystem::copy_file(segment_path(other.folder().path(), 7),
                             segment_path(harness_.folder().path(), 8));
  ArtifactRef ref = other.artifacts()[0];
  harness_.artifacts().push_back(ref);
  merge_fails(ErrorCode::kCorrupt);
}

TEST_F(MergeErrors, CanceledMergesStop) {
  CancelToken cancel;
  cancel.cancel();
  merge_fails(ErrorCode::kCanceled, {.cancel = &cancel});
}

// The error for a level that exceeds a limit of the format names the level and the limit.
TEST(LevelExtentTest, ALevelOverTheLimitIsALimitError) {
  for (const auto& [in_words, limit, text] : {std::tuple{true, uint64_t{1} << 40, "2^40 words"},
                                              {false, uint64_t{1} << 32, "2^32 nodes"}}) {
    LevelExtent extent;
    extent.add({1, limit}, 9, in_words);
    try {
      extent.add({1, 2}, 9, in_words);
      FAIL() << "expected an Error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kLimit);
      EXPECT_THAT(error.message(), testing::HasSubstr("level 9"));
      EXPECT_THAT(error.message(), testing::HasSubstr(text));
    }
  }
}

}  // namespace
}  // namespace voxdag
