#include "query/combine/spill/node_values.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/oracle/scenes.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kValueWords = 100'003;

// Returns the nodes of a level: their word offsets, and a value for some of them.
std::map<uint64_t, uint64_t> random_values(uint64_t seed, uint64_t& nodes) {
  oracle::Random random(seed);
  std::map<uint64_t, uint64_t> values;
  nodes = 0;
  for (uint64_t offset = 0; offset < kValueWords - 1;
       offset += static_cast<uint64_t>(random.between(2, 9)), ++nodes)
    if (random.between(0, 4) > 0)
      values[offset] = static_cast<uint64_t>(random.between(0, 1 << 30));
  return values;
}

class NodeValuesTest : public testing::Test {
 protected:
  // Looks up every word of the level and some words after it.
  void expect_values(const std::map<uint64_t, uint64_t>& expected, uint64_t nodes,
                     uint64_t resident_bytes, bool is_resident) {
    MemoryBudget budget(uint64_t{16} << 20);
    const SpillSpace space{scratch_, budget, 4096, 4096, 1024};
    voxdag_reader::Level level{.word_count = kValueWords};
    level.node_count = nodes;
    NodeValues<uint64_t> values(space, level, resident_bytes);
    ASSERT_EQ(values.is_resident(), is_resident);
    for (const auto& [offset, value] : expected) values.add(offset, value);
    values.finish();
    NodeLookups<NodeValues<uint64_t>> lookups(values, space, 4096);
    ASSERT_NE(lookups.needs_announcement(), is_resident);
    if (lookups.needs_announcement()) {
      for (uint64_t word = 0; word < kValueWords + 40; ++word) lookups.announce(word);
      lookups.resolve();
    }
    for (uint64_t word = 0; word < kValueWords + 40; ++word) {
      const FoundValue<uint64_t> found = lookups.next(word);
      ASSERT_EQ(found.begins != 0, expected.contains(word)) << word;
      if (!found.begins) continue;
      ASSERT_EQ(found.value, expected.at(word)) << word;
    }
  }

  TemporaryFolder folder_;
  ScratchFolder scratch_{system_files(), folder_.path()};
};

TEST_F(NodeValuesTest, FindsValuesInMemoryAndInAFile) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    uint64_t nodes = 0;
    const auto values = random_values(seed, nodes);
    ASSERT_GT(values.size(), 10'000u);
    const uint64_t needed = 8 * nodes + 8 * (kValueWords / 16 + 1);
    expect_values(values, nodes, needed, true);
    expect_values(values, nodes, needed - 1, false);
  }
}

// A damaged file can have more nodes than its directory says, or fewer.
TEST_F(NodeValuesTest, SurvivesWrongNodeCounts) {
  MemoryBudget budget(uint64_t{1} << 20);
  const SpillSpace space{scratch_, budget, 4096, 4096, 1024};
  for (const uint64_t count : {uint64_t{0}, uint64_t{3}, ~uint64_t{0}}) {
    voxdag_reader::Level level{.word_count = 20};
    level.node_count = count;
    NodeValues<uint64_t> values(space, level, 1024);
    ASSERT_TRUE(values.is_resident());
    for (uint64_t offset = 0; offset < 20; offset += 2) values.add(offset, offset + 100);
    values.finish();
    NodeLookups<NodeValues<uint64_t>> lookups(values, space, 4096);
    for (uint64_t offset = 0; offset < 20; offset += 2) {
      const FoundValue<uint64_t> found = lookups.next(offset);
      ASSERT_EQ(found.begins != 0, offset < 2 * std::min<uint64_t>(count, 10));
      if (!found.begins) continue;
      ASSERT_EQ(found.value, offset + 100);
    }
  }
}

}  // namespace
}  // namespace voxdag::query
