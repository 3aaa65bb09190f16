#include "query/combine/spill/kept_places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/oracle/scenes.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kLevelWords = 100'000;

// Returns a new offset for some words of a level. The shift changes rarely, so that it is the same
// for all nodes of some blocks, and different in others.
std::map<uint64_t, uint64_t> random_places(uint64_t seed) {
  oracle::Random random(seed);
  std::map<uint64_t, uint64_t> places;
  uint64_t added = seed % 2 == 0 ? 0 : 1000, removed = 0;
  const auto node_words = [&] { return static_cast<uint64_t>(random.between(2, 9)); };
  for (uint64_t offset = node_words(); offset < kLevelWords - 1; offset += node_words()) {
    if (random.between(0, 40) == 0) added += node_words();
    if (random.between(0, 60) == 0) removed += std::min(node_words(), offset + added - removed);
    if (random.between(0, 9) > 0) places[offset] = offset + added - removed;
  }
  return places;
}

class KeptPlacesTest : public testing::Test {
 protected:
  // Looks up all offsets of `places`, several times each.
  void expect_places(const std::map<uint64_t, uint64_t>& places, uint64_t resident_bytes,
                     bool is_resident) {
    MemoryBudget budget(uint64_t{16} << 20);
    const SpillSpace space{scratch_, budget, 4096, 4096, 1024};
    const voxdag_reader::Level level{.word_count = kLevelWords};
    KeptPlaces kept(space, level, resident_bytes);
    ASSERT_EQ(kept.is_resident(), is_resident);
    for (const auto& [offset, place] : places) kept.add(offset, place);
    kept.finish();
    NodeLookups<KeptPlaces> lookups(kept, space, 4096);
    for (int turn = 0; turn < 2 && lookups.needs_announcement(); ++turn)
      for (const auto& [offset, place] : places) lookups.announce(offset);
    if (lookups.needs_announcement()) lookups.resolve();
    for (int turn = 0; turn < 2; ++turn)
      for (const auto& [offset, place] : places)
        ASSERT_EQ(lookups.next(offset).value, place) << offset;
  }

  TemporaryFolder folder_;
  ScratchFolder scratch_{system_files(), folder_.path()};
};

TEST_F(KeptPlacesTest, FindsShiftedOffsets) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const auto places = random_places(seed);
    ASSERT_GT(places.size(), 10'000u);
    expect_places(places, uint64_t{1} << 20, true);
    expect_places(places, 100'000, false);
  }
}

// The first nodes of a file can be left out, so that all others move to the front.
TEST_F(KeptPlacesTest, FindsOffsetsThatDecrease) {
  std::map<uint64_t, uint64_t> places;
  uint64_t place = 0;
  for (uint64_t offset = 50'001; offset < kLevelWords - 1; offset += 3) {
    places[offset] = place;
    place += offset % 2 == 0 || offset > 60'000 ? 3 : 2;
  }
  expect_places(places, uint64_t{1} << 20, true);
}

}  // namespace
}  // namespace voxdag::query
