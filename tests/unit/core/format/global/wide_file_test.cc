// Files with wide levels (levels to which pointers have 64 bits; version 2 of the format), and
// files whose headers describe such levels wrongly.
#include <gmock/gmock.h>

#include <cstring>

#include "core/format/checksum.h"
#include "core/format/global/diff.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/core/format/verify_both_ways.h"

namespace voxdag {
namespace {

using namespace global_layout;
using testing::HasSubstr;
using testing::MatchesRegex;

constexpr int kEdge = 64;
constexpr uint64_t kNarrowWords = 50;  // a level of more words is wide, such as the bricks' level
constexpr uint32_t kBrickLevel = 4;
constexpr size_t kPointerBitsAt = 24;  // in a level's entry

class WideFileTest : public testing::Test {
 protected:
  WideFileTest() { write_global(path_, dag_, grid_of(kEdge), 64, kNarrowWords); }

  static void verify(const std::string& path, uint64_t narrow_words = kNarrowWords) {
    verify_both_ways(*open_global_file(path), {2, narrow_words});
  }
  // Replaces the header's bytes at offset `at` by `value`, and corrects the header's checksum.
  // Returns the error of opening or verifying the changed file.
  template <class T>
  Error error_with(size_t at, T value) const {
    ByteString bytes = read_bytes(path_);
    std::memcpy(bytes.data() + at, &value, sizeof value);
    const auto header = std::as_bytes(std::span(bytes)).first(kHeaderChecksumAt);
    const uint64_t checksum = checksum64(header);
    std::memcpy(bytes.data() + kHeaderChecksumAt, &checksum, sizeof checksum);
    const std::string changed = folder_.file("changed.vdag");
    write_bytes(changed, bytes);
    return error_of([&] { verify(changed, narrow_words_); });
  }

  void make_narrow() {
    narrow_words_ = uint64_t{1} << 32;
    write_global(path_, dag_, grid_of(kEdge), 64, narrow_words_);
  }

  TemporaryFolder folder_;
  uint64_t narrow_words_ = kNarrowWords;
  const std::string path_ = folder_.file("wide.vdag");
  const oracle::Dag dag_ = oracle::build_dag(noise_voxels(9, kEdge, 6000), 64);
};

TEST_F(WideFileTest, HasTheVoxelsOfTheNarrowFile) {
  const std::string narrow = folder_.file("narrow.vdag");
  for (const uint64_t words : {2u, 50u, 100u}) {
    SCOPED_TRACE(words);
    write_global(path_, dag_, grid_of(kEdge), 64, words);
    write_global(narrow, dag_, grid_of(kEdge), 64, uint64_t{1} << 32);
    EXPECT_NO_THROW(verify(path_, words));
    const auto a = open_global_file(path_), b = open_global_file(narrow);
    EXPECT_EQ(a->version(), 2u);
    EXPECT_EQ(b->version(), 1u);
    for (uint32_t level = 0; level <= kBrickLevel; ++level)
      EXPECT_EQ(a->level(level).pointer_bits, a->level(level).word_count > words ? 64u : 32u);
    MemoryBudget budget(uint64_t{1} << 30);
    EXPECT_TRUE(diff_global_files(*a, *b, 2, budget, {}).same());
    oracle::Random random(1);
    for (int i = 0; i < 1000; ++i) {
      const int64_t x = random.between(-1, kEdge), y = random.between(-1, kEdge),
                    z = random.between(-1, kEdge);
      EXPECT_EQ(a->voxel(x, y, z), b->voxel(x, y, z));
    }
  }
}

TEST_F(WideFileTest, UnknownFeaturesAreNotRead) {
  for (const uint64_t features : {uint64_t{4}, uint64_t{5}, uint64_t{1} << 63}) {
    const Error error = error_with(kFeaturesAt, features);
    EXPECT_EQ(error.code(), ErrorCode::kUnsupportedVersion);
    EXPECT_THAT(error.message(), HasSubstr("feature bits " + std::to_string(features)));
  }
  EXPECT_EQ(error_with(kVersionAt, uint32_t{3}).code(), ErrorCode::kUnsupportedVersion);
}

TEST_F(WideFileTest, PointersOfOtherWidthsAreRefused) {
  const size_t bricks = kLevelsAt + kBrickLevel * kLevelEntryBytes + kPointerBitsAt;
  for (const uint32_t bits : {0u, 1u, 16u, 63u, 65u, 128u, ~0u})
    EXPECT_THAT(error_with(bricks, bits).message(),
                HasSubstr("header: level 4: pointers of " + std::to_string(bits) +
                          " bits, expected 32 or 64"));
  // 32 bits is a valid width, but the bricks' parents have pointers of 64 bits, so their words do
  // not match the header.
  EXPECT_EQ(error_with(bricks, uint32_t{32}).code(), ErrorCode::kCorrupt);
  EXPECT_EQ(error_with(kLevelsAt + kPointerBitsAt, uint32_t{33}).code(), ErrorCode::kCorrupt);
}

// The number of a level's words determines the width of pointers to it, so that equal voxels always
// give the same file. `verify` refuses another width.
TEST_F(WideFileTest, OtherThresholdsAreNotCanonical) {
  EXPECT_THAT(error_of([&] { verify(path_, uint64_t{1} << 32); }).message(),
              MatchesRegex(".*level 1: pointers of 64 bits into [0-9]+ words, expected 32"));
  const std::string narrow = folder_.file("narrow.vdag");
  write_global(narrow, dag_, grid_of(kEdge), 64, uint64_t{1} << 32);
  EXPECT_THAT(error_of([&] { verify(narrow); }).message(),
              MatchesRegex(".*level 1: pointers of 32 bits into [0-9]+ words, expected 64"));
}

// A wide pointer is the low word plus 2^32 times the high word.
TEST(WideNodeTest, HasPointersOfTwoWords) {
  const uint32_t words[] = {5, 255, 7, 0};
  const voxdag_reader::Node node{0x82, words, true};
  EXPECT_EQ(node.child(0), (uint64_t{255} << 32) + 5);
  EXPECT_EQ(voxdag_reader::File::child(node, 7), 7u);
  const voxdag_reader::Node narrow{0x82, words, false};
  EXPECT_EQ(narrow.child(0), 5u);
  EXPECT_EQ(narrow.child(1), 255u);
}

TEST_F(WideFileTest, VersionAndFeaturesBelongTogether) {
  EXPECT_THAT(error_with(kFeaturesAt, uint64_t{0}).message(),
              HasSubstr("pointers of 64 bits, expected 32"));
  // Bytes that are not 0 in this file are reserved in version 1.
  EXPECT_EQ(error_with(kVersionAt, uint32_t{1}).code(), ErrorCode::kCorrupt);
  make_narrow();
  EXPECT_THAT(error_with(kFeaturesAt, uint64_t{1}).message(), HasSubstr("reserved"));
  EXPECT_EQ(error_with(kVersionAt, uint32_t{2}).code(), ErrorCode::kCorrupt);
}

// A level may not have more words than the pointers to this level can address.
TEST_F(WideFileTest, NarrowPointersReachTwoToThe32) {
  const size_t bricks = kLevelsAt + kBrickLevel * kLevelEntryBytes;
  EXPECT_THAT(error_with(bricks + 16, (uint64_t{1} << 40) + 1).message(),
              HasSubstr(" words, expected at most 2^40 with pointers of 64 bits"));
  make_narrow();
  EXPECT_THAT(error_with(bricks + 16, (uint64_t{1} << 32) + 1).message(),
              HasSubstr(" words, expected at most 2^32 with pointers of 32 bits"));
}

}  // namespace
}  // namespace voxdag
