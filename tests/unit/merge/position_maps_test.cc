// Tests positions (merge/load/row.h) of one word and of two words: in rows, in position maps, and
// in the output.
#include "merge/load/position_maps.h"

#include <gmock/gmock.h>

#include <array>

#include "merge/output/merged_rows.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

using testing::ElementsAre;

constexpr uint64_t kLast = (uint64_t{1} << 40) - 1;  // the last word of a wide level
constexpr std::array<uint64_t, 5> kPositions = {0, UINT32_MAX, uint64_t{1} << 32,
                                                (uint64_t{3} << 32) + 7, kLast};

TEST(Positions, AreOneWordOrTwo) {
  uint32_t words[2] = {};
  for (const uint64_t position : kPositions) {
    EXPECT_EQ(put_position(words, position, true), words + 2);
    EXPECT_EQ(get_position(words, true), position);
  }
  EXPECT_EQ(put_position(words, UINT32_MAX, false), words + 1);
  EXPECT_EQ(get_position(words, false), UINT32_MAX);
}

// Positions in a wide level need 64 bits. Its position maps keep the high halves of positions, in
// memory and in a file.
TEST(Positions, OfWideMapsKeepTheirHighHalf) {
  const TemporaryFolder folder;
  MemoryBudget budget(uint64_t{1} << 20);
  ScratchFolder scratch(system_files(), folder.path());
  const std::vector<uint64_t> rows = {2, kPositions.size()};
  std::vector<uint32_t> words(2 * kPositions.size());
  for (size_t i = 0; i < kPositions.size(); ++i) put_position(&words[2 * i], kPositions[i], true);
  for (const uint64_t resident_bytes : {0, 1 << 20}) {
    PositionMaps maps(rows, true, resident_bytes, scratch, budget);
    EXPECT_EQ(maps.is_resident(), resident_bytes > 0);
    maps.store(0, 0, std::span(words).first(4));
    maps.store(1, 0, words);
    for (size_t i = 0; i < kPositions.size(); ++i) EXPECT_EQ(maps.at(1, i), kPositions[i]);
    std::vector<uint32_t> loaded(4);
    maps.load(1, 3, loaded);
    EXPECT_EQ(get_position(&loaded[2], true), kLast);
  }
}

// In the file, the low half of a pointer is first. In a row, the high half is first, so that
// comparing rows word by word compares pointers.
TEST(Positions, AreWrittenLowHalfFirst) {
  MemoryBudget budget(uint64_t{1} << 20);
  MergedRows rows(budget, {.bricks = false, .wide = true}, {.rows = 2, .words = 8});
  uint32_t words[kMaxRowWords] = {};
  put_position(put_position(words, (uint64_t{3} << 32) + 7, true), kLast, true);
  rows.push(1, 0x81, words);
  EXPECT_THAT(rows.words(), ElementsAre(0x81, 7, 3, UINT32_MAX, 255));
}

}  // namespace
}  // namespace voxdag
