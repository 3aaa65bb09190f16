// Tests the index of a level: the word offsets at which nodes begin. For any words, the index that
// is made from several spans of the level equals the index that a single walk finds.
#include "core/format/global/node_index.h"

#include <gmock/gmock.h>

#include <random>

#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "tests/support/error_of.h"

namespace voxdag {
namespace {

struct Walked {
  std::vector<uint32_t> words;
  std::vector<uint64_t> begins;
};

class NodeIndexTest : public testing::TestWithParam<Pointers> {
 protected:
  // Returns nodes with random masks and with pointers below `limit`.
  Walked random_level(uint64_t seed, size_t nodes, uint32_t limit) const {
    std::mt19937_64 random(seed);
    Walked level;
    for (size_t i = 0; i < nodes; ++i) {
      level.begins.push_back(level.words.size());
      level.words.push_back(static_cast<uint32_t>(1 + random() % 255));
      const int children = kPopcount8[level.words.back()];
      for (int word = children << (GetParam() == Pointers::kWide); word > 0; --word)
        level.words.push_back(static_cast<uint32_t>(random() % limit));
    }
    return level;
  }
  NodeIndex index_of(const Walked& level, unsigned threads) {
    voxdag_reader::Level l;
    l.words = level.words.data();
    l.word_count = level.words.size();
    l.node_count = level.begins.size();
    return NodeIndex(l, GetParam(), threads, budget_, {}, "level 3");
  }
  void expect_index(const Walked& level) {
    for (const unsigned threads : {1u, 3u}) {
      const NodeIndex index = index_of(level, threads);
      std::vector<uint64_t> visited;
      for (uint64_t span = 0; span < index.span_count(); ++span) {
        if (span > 0) {
          EXPECT_EQ(index.last_before(span), visited.back());
        }
        index.visit_span(span, [&](uint64_t i, uint64_t at) {
          ASSERT_EQ(i, visited.size());
          visited.push_back(at);
        });
      }
      EXPECT_EQ(visited, level.begins);
      for (size_t i = 0; i < level.begins.size(); ++i) {
        ASSERT_EQ(index.find(level.begins[i]), i);
        ASSERT_EQ(index.find(level.begins[i] + 1), NodeIndex::kNone);
      }
      EXPECT_EQ(index.find(level.words.size()), NodeIndex::kNone);
    }
  }
  MemoryBudget budget_{uint64_t{1} << 30};
};

TEST_P(NodeIndexTest, LevelsOfSeveralSpans) {
  for (const size_t nodes : {1u, 5u, 100'000u}) expect_index(random_level(nodes, nodes, ~0u));
}

// Nearly every word looks like a child mask, so guessed starts of spans are often wrong. The index
// must be right nevertheless.
TEST_P(NodeIndexTest, PointersThatLookLikeMasks) { expect_index(random_level(1, 100'000, 256)); }

// With any number of threads, the message is about the first wrong word.
TEST_P(NodeIndexTest, BrokenMasks) {
  std::mt19937_64 random(7);
  for (int round = 0; round < 20; ++round) {
    Walked level = random_level(3, 100'000, round % 2 ? ~0u : 256);
    size_t first = level.begins.size();
    for (int i = 0; i < 3; ++i) {
      const size_t node = random() % level.begins.size();
      level.words[level.begins[node]] = 256;
      first = std::min(first, node);
    }
    for (const unsigned threads : {1u, 4u})
      EXPECT_EQ(error_of([&] { index_of(level, threads); }).message(),
                "level 3, word " + std::to_string(level.begins[first]) +
                    ": child mask 256, expected 1 to 255");
  }
}

TEST_P(NodeIndexTest, EndAndCount) {
  Walked level = random_level(4, 100'000, ~0u);
  level.words.pop_back();
  EXPECT_THAT(error_of([&] { index_of(level, 2); }).message(),
              testing::HasSubstr("its last node ends at word"));
  level = random_level(4, 100'000, ~0u);
  level.begins.pop_back();
  EXPECT_EQ(error_of([&] { index_of(level, 2); }).message(),
            "level 3: its words hold 100000 nodes, expected 99999");
}

INSTANTIATE_TEST_SUITE_P(Widths, NodeIndexTest,
                         testing::Values(Pointers::kNarrow, Pointers::kWide));

}  // namespace
}  // namespace voxdag
