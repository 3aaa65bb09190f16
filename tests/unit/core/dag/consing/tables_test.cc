#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "core/dag/consing/brick_table.h"
#include "core/dag/consing/node_table.h"
#include "core/dag/level_array.h"
#include "core/dag/node_hash.h"
#include "tests/oracle/scenes.h"

namespace voxdag {
namespace {

class Tables : public testing::Test {
 protected:
  MemoryBudget budget_{uint64_t{1} << 30};
  PagePool pool_;
  PooledMemory memory_{budget_, pool_};
  oracle::Random random_{5};

  uint64_t word() { return hash_brick(static_cast<uint64_t>(random_.between(0, INT64_MAX - 1))); }
};

// Equal masks get equal ids, and different masks get different ids, also after the table has grown
// many times.
TEST_F(Tables, BricksAreFoundAgain) {
  BrickTable table(memory_);
  std::map<uint64_t, uint32_t> truth;
  for (int i = 0; i < 200000; ++i) {
    const uint64_t mask = i % 3 ? word() | 1 : static_cast<uint64_t>(random_.between(1, 500));
    table.reserve(1);
    const uint32_t id = table.find_or_add(mask, hash_brick(mask));
    const auto [at, added] = truth.emplace(mask, id);
    ASSERT_EQ(at->second, id);
    ASSERT_TRUE(!added || id == truth.size() - 1);
  }
  EXPECT_EQ(table.size(), truth.size());
}

// Slots are sorted by hash, and by mask if hashes are equal. The hashes have 64 bits or are
// truncated to fewer bits.
TEST_F(Tables, BricksAreSorted) {
  for (const uint32_t bits : {64u, 33u, 16u, 4u}) {
    SCOPED_TRACE(bits);
    BrickTable table(memory_);
    for (int i = 0; i < 5000; ++i) {
      const uint64_t mask = word() | 1;
      table.reserve(1);
      table.find_or_add(mask, hash_brick(mask));
    }
    const auto slots = table.sort_slots(bits);
    ASSERT_EQ(slots.size(), table.size());
    for (size_t i = 1; i < slots.size(); ++i) {
      const uint64_t a = truncate_hash(hash_brick(slots[i - 1].mask), bits);
      const uint64_t b = truncate_hash(hash_brick(slots[i].mask), bits);
      ASSERT_TRUE(a < b || (a == b && slots[i - 1].mask < slots[i].mask)) << i;
    }
  }
}

struct Node {
  uint64_t hash;
  uint32_t mask;
  std::vector<uint32_t> children;
  auto operator<=>(const Node&) const = default;
};

// Adds nodes with few different hashes, so that nodes collide in slots, in tags (the upper half of
// the hash), and in complete hashes. Some hashes are the highest possible ones, so that runs of
// used slots wrap around from the end of the table to its start.
class NodeTables : public Tables {
 protected:
  // Adds a node to the table, and returns its id. Sets the array elements after the node's last
  // child to random values, because they must not affect the result.
  uint32_t add(NodeTable& table, const Node& node) {
    uint32_t children[8];
    for (uint32_t& child : children) child = static_cast<uint32_t>(random_.between(0, 3));
    std::copy(node.children.begin(), node.children.end(), children);
    return table.find_or_add(node.hash, node.mask, children, popcount64(node.mask));
  }

  Node random_node(int distinct_hashes) {
    Node node;
    node.mask = static_cast<uint32_t>(random_.between(1, 255));
    for (int i = 0; i < popcount64(node.mask); ++i)
      node.children.push_back(static_cast<uint32_t>(random_.between(0, 3)));
    uint64_t pick = node.mask;
    for (const uint32_t child : node.children) pick = pick * 7 + child;
    pick %= static_cast<uint64_t>(distinct_hashes);
    node.hash = pick % 2 ? ~pick : hash_brick(pick);
    return node;
  }
};

// A node is found again by mask and children, never by its hash alone.
TEST_F(NodeTables, NodesAreFoundAgainWhateverTheirHashes) {
  for (const int distinct : {1, 50, 100000}) {
    SCOPED_TRACE(distinct);
    NodeTable table(memory_);
    std::map<Node, uint32_t> truth;
    for (int i = 0; i < (distinct == 1 ? 1000 : 20000); ++i) {
      const Node node = random_node(distinct);
      table.reserve(1);
      const uint32_t id = add(table, node);
      ASSERT_EQ(truth.emplace(node, id).first->second, id);
      NodeTable::Record record = table.record(id);
      ASSERT_EQ(record.hash(), node.hash);
      ASSERT_EQ(record.mask(), node.mask);
      ASSERT_TRUE(std::equal(node.children.begin(), node.children.end(), record.children()));
    }
    EXPECT_EQ(table.size(), truth.size());
  }
}

// sort_slots() sorts slots by the total order (hash, mask, children), including nodes with equal
// hashes and runs of slots that wrap around at the end of the table. The same holds if the test
// changes the hashes in the records and passes hashes_changed = true.
TEST_F(NodeTables, SlotsAreInTheTotalOrder) {
  for (const int distinct : {1, 20, 100000})
    for (const bool changed : {false, true}) {
      SCOPED_TRACE(testing::Message() << distinct << ", changed " << changed);
      NodeTable table(memory_);
      std::vector<Node> truth;
      for (int i = 0; i < 3000; ++i) {
        const Node node = random_node(distinct);
        table.reserve(1);
        add(table, node);
      }
      table.for_each_record([&](NodeTable::Record record) {
        if (changed) record.set_hash(hash_brick(record.hash()) >> 60);
        truth.push_back({record.hash(),
                         record.mask(),
                         {record.children(), record.children() + record.child_count()}});
      });
      std::sort(truth.begin(), truth.end());
      const auto slots = table.sort_slots(changed);
      ASSERT_EQ(slots.size(), truth.size());
      for (size_t i = 0; i < slots.size(); ++i) {
        NodeTable::Record record = table.record(static_cast<uint32_t>(slots[i]));
        const Node node{record.hash(),
                        record.mask(),
                        {record.children(), record.children() + record.child_count()}};
        ASSERT_EQ(node, truth[i]) << i;
      }
    }
}

// A table that cannot grow throws OutOfBudget. After its destruction nothing is charged.
TEST_F(NodeTables, ThrowsWithoutMemoryToGrow) {
  MemoryBudget small(64 << 10);
  PooledMemory memory{small, pool_};
  {
    NodeTable table(memory);
    EXPECT_THROW(
        for (uint32_t i = 1; i < 10000; ++i) {
          table.reserve(1);
          const uint32_t children[8] = {i};
          table.find_or_add(hash_brick(i), 1, children, 1);
        },
        OutOfBudget);
    EXPECT_GT(table.size(), 500u);
  }
  EXPECT_EQ(small.used(), 0u);
  EXPECT_LE(small.peak(), small.limit());
}

}  // namespace
}  // namespace voxdag
