// Compares the primitives of HostSpace with loops of the standard library. HostSpace divides arrays
// into one part per thread, so the sizes are around the size of such a part.
#include "core/backend/parallel/space/host_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

namespace voxdag::parallel {
namespace {

constexpr uint32_t kSizes[] = {0, 1, 2, 255, 4095, 4096, 4097, 8191, 8192, 20000, 65537};

class HostSpaceTest : public testing::TestWithParam<unsigned> {
 protected:
  template <class T>
  SpaceArray<HostSpace, T> filled(const std::vector<T>& values, size_t extra = 0) {
    SpaceArray<HostSpace, T> buffer(space, values.size() + extra);
    std::copy(values.begin(), values.end(), buffer.data());
    return buffer;
  }
  std::vector<uint64_t> random_words(uint32_t n, uint64_t below) {
    std::vector<uint64_t> words(n);
    for (uint64_t& w : words) w = below ? random() % below : random();
    return words;
  }

  MemoryBudget budget{uint64_t{1} << 30};
  CancelToken cancel;
  HostSpace space{budget, cancel, GetParam()};
  std::mt19937_64 random{7};
};
INSTANTIATE_TEST_SUITE_P(Threads, HostSpaceTest, testing::Values(1u, 2u, 5u));

TEST_P(HostSpaceTest, ForEachMeetsEveryIndexOnce) {
  for (const uint32_t n : kSizes) {
    std::vector<uint8_t> met(n);
    space.for_each(n, [&](uint32_t i) { ++met[i]; });
    EXPECT_EQ(std::count(met.begin(), met.end(), 1), n);
  }
}

TEST_P(HostSpaceTest, ScanGivesExclusiveSumsAndTheTotal) {
  for (const uint32_t n : kSizes) {
    std::vector<uint32_t> counts(n);
    for (uint32_t& c : counts) c = static_cast<uint32_t>(random() % 9);
    auto buffer = filled(counts, 1);
    buffer.data()[n] = 12345;  // scan() overwrites this element with the total
    space.scan(buffer.data(), n);
    counts.push_back(0);
    std::exclusive_scan(counts.begin(), counts.end(), counts.begin(), 0u);
    EXPECT_TRUE(std::equal(counts.begin(), counts.end(), buffer.data())) << n;
  }
}

TEST_P(HostSpaceTest, SelectKeepsFlaggedPositionsInOrder) {
  for (const uint32_t n : kSizes) {
    std::vector<uint8_t> flags(n);
    for (uint8_t& f : flags) f = random() % 3 == 0;
    std::vector<uint32_t> expected;
    for (uint32_t i = 0; i < n; ++i)
      if (flags[i]) expected.push_back(i);
    SpaceArray<HostSpace, uint32_t> out(space, n);
    ASSERT_EQ(space.select(flags.data(), n, out.data()), expected.size());
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), out.data())) << n;
  }
}

// Each run of equal keys becomes one key and the OR of its masks, even if the run is longer than a
// thread's part of the keys.
TEST_P(HostSpaceTest, MergeRunsOrsEqualKeys) {
  for (const uint32_t n : kSizes)
    for (const uint64_t longest : {1, 7, 30000}) {
      std::vector<uint64_t> keys(n), masks = random_words(n, 0), out_keys, out_masks;
      uint64_t key = 0, left = 0;
      for (uint64_t& k : keys) {
        if (left-- == 0) left = random() % longest, ++key;
        k = key;
      }
      for (uint32_t i = 0; i < n; ++i) {
        if (i == 0 || keys[i] != keys[i - 1]) out_keys.push_back(keys[i]), out_masks.push_back(0);
        out_masks.back() |= masks[i];
      }
      SpaceArray<HostSpace, uint64_t> k(space, n), m(space, n);
      ASSERT_EQ(space.merge_runs(keys.data(), masks.data(), n, k.data(), m.data()),
                out_keys.size());
      EXPECT_TRUE(std::equal(out_keys.begin(), out_keys.end(), k.data())) << n;
      EXPECT_TRUE(std::equal(out_masks.begin(), out_masks.end(), m.data())) << n;
    }
}

TEST_P(HostSpaceTest, CountBits) {
  for (const uint32_t n : kSizes) {
    const auto masks = random_words(n, 0);
    uint64_t expected = 0;
    for (const uint64_t m : masks) expected += static_cast<uint64_t>(popcount64(m));
    EXPECT_EQ(space.count_bits(masks.data(), n), expected);
  }
}

// A sort by a range of bits ignores the other bits, and preserves the order of keys whose bits in
// the range are equal.
TEST_P(HostSpaceTest, SortsAreStableByTheBitsGiven) {
  for (const uint32_t n : kSizes)
    for (const auto& [begin, end] : {std::pair{0, 64}, {0, 0}, {3, 4}, {5, 30}, {60, 64}, {0, 9}}) {
      auto keys = random_words(n, n % 2 ? 0 : 50);
      if (begin == 60)
        for (uint64_t& k : keys) k <<= 57;
      std::vector<uint32_t> order(n);
      std::iota(order.begin(), order.end(), 0u);
      const auto part = [begin = begin, end = end](uint64_t key) {
        return end == begin ? 0 : key >> begin & (~uint64_t{0} >> (64 - (end - begin)));
      };
      auto k = filled(keys), only_keys = filled(keys);
      auto v = filled(order);
      SpaceArray<HostSpace, uint64_t> key_scratch(space, n);
      SpaceArray<HostSpace, uint32_t> value_scratch(space, n);
      space.sort_pairs(k, key_scratch, v, value_scratch, n, {.begin = begin, .end = end});
      space.sort_keys(only_keys, key_scratch, n, {.begin = begin, .end = end});
      std::stable_sort(order.begin(), order.end(),
                       [&](uint32_t a, uint32_t b) { return part(keys[a]) < part(keys[b]); });
      for (uint32_t i = 0; i < n; ++i) {
        ASSERT_EQ(v.data()[i], order[i]) << n << " items by bits " << begin << " to " << end;
        ASSERT_EQ(k.data()[i], keys[order[i]]);
        ASSERT_EQ(only_keys.data()[i], keys[order[i]]);
      }
    }
}

// expand() visits each output once, and passes its source and its rank among the outputs of this
// source. Some sources have no outputs. Any range of the sources can be expanded.
TEST_P(HostSpaceTest, ExpandVisitsEveryOutputOfItsSource) {
  for (const uint32_t n : {1u, 2u, 100u, 5000u}) {
    std::vector<uint32_t> offsets(n + 1);
    for (uint32_t s = 0; s < n; ++s)
      offsets[s + 1] =
          offsets[s] + (random() % 3 ? 0 : static_cast<uint32_t>(random() % (s % 90 ? 5 : 6000)));
    for (const auto& [first, last] : {std::pair{0u, n}, {n / 3, n / 2 + 1}, {n, n}}) {
      const uint32_t count = offsets[last] - offsets[first];
      std::vector<std::pair<uint32_t, uint32_t>> met(count);
      space.expand(offsets.data(), first, last, count,
                   [&](uint32_t source, uint32_t rank, uint32_t output) {
                     met[output] = {source, rank};
                   });
      uint32_t output = 0;
      for (uint32_t s = first; s < last; ++s)
        for (uint32_t rank = 0; rank < offsets[s + 1] - offsets[s]; ++rank, ++output)
          ASSERT_EQ(met[output], std::pair(s, rank)) << n << " sources, output " << output;
    }
  }
}

// A thread block kernel (thread_block.h) whose second phase reads what other threads of the block
// wrote in the first phase.
struct ReverseInBlocks {
  static constexpr uint32_t kThreads = 32;
  static constexpr int kPhases = 2;
  struct Shared {
    uint32_t values[kThreads];
  };
  uint32_t* out;
  void operator()(int phase, uint32_t block, uint32_t thread, Shared& shared) const {
    if (phase == 0)
      shared.values[thread] = thread + 100 * block;
    else
      out[block * kThreads + thread] = shared.values[kThreads - 1 - thread];
  }
};
TEST_P(HostSpaceTest, BlocksRunPhaseByPhase) {
  std::vector<uint32_t> out(9 * 32);
  space.for_each_thread_block(9, ReverseInBlocks{out.data()});
  for (uint32_t i = 0; i < out.size(); ++i) EXPECT_EQ(out[i], 31 - i % 32 + 100 * (i / 32));
}

// Exceeding the budget throws OutOfBudget, and nothing remains charged.
TEST_P(HostSpaceTest, BuffersAreCharged) {
  MemoryBudget small(1 << 20);
  HostSpace here(small, cancel, GetParam());
  {
    const SpaceArray<HostSpace, uint64_t> half(here, (1 << 20) / 16);
    EXPECT_EQ(small.used(), uint64_t{1} << 19);
    EXPECT_THROW((SpaceArray<HostSpace, uint8_t>(here, (1 << 19) + 1)), OutOfBudget);
    EXPECT_THROW((SpaceArray<HostSpace, uint8_t>(space, kMaxElements + 1)), OutOfBudget);
  }
  EXPECT_EQ(small.used(), 0u);
}

TEST_P(HostSpaceTest, EveryLoopLooksAtTheCancelToken) {
  cancel.cancel();
  uint32_t counts[2] = {1, 1};
  EXPECT_THROW(space.for_each(1, [](uint32_t) {}), Error);
  EXPECT_THROW(space.scan(counts, 1), Error);
  EXPECT_THROW(space.staging(nullptr, 0), Error);
}

}  // namespace
}  // namespace voxdag::parallel
