#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "core/backend/cpu/memo/block_memo.h"
#include "core/dag/brick.h"
#include "core/dag/node_hash.h"
#include "tests/unit/core/backend/cpu/tiles.h"

namespace voxdag::cpu {
namespace {

class Blocks : public testing::Test {
 protected:
  oracle::Random random_{3};

  uint64_t word() { return hash_brick(static_cast<uint64_t>(random_.between(0, INT64_MAX - 1))); }
  VoxelBlock random_block() {
    VoxelBlock block{};
    for (uint64_t& brick : block.bricks)
      if (random_.between(0, 2) == 0) brick = word();
    return block;
  }
  static bool equal(const VoxelBlock& a, const VoxelBlock& b) {
    return std::equal(a.bricks, a.bricks + kBlockBricks, b.bricks);
  }
};

// list_blocks() lists the non-empty blocks in order, each with its block_key(). It clears the marks
// (TileBricks::touched) of all blocks, including empty ones.
TEST_F(Blocks, KernelsListThem) {
  for (const Kernels* kernels : all_kernels())
    for (int round = 0; round < 50; ++round) {
      SCOPED_TRACE(round);
      const auto tile = std::make_unique<TileBricks>();
      std::vector<int> truth;
      const int groups = round % 2 ? 1 : kTileBlocks / 8;
      for (int number = 0; number < 8 * groups; ++number) {
        if (random_.between(0, 3) == 0) continue;
        if (random_.between(0, 3) > 0) tile->blocks[number] = random_block();
        tile->touched[number] = 1;
        if (!equal(tile->blocks[number], {})) truth.push_back(number);
      }
      uint8_t existing[kTileBlocks / 8];
      uint16_t numbers[kTileBlocks + 1];
      uint64_t keys[kTileBlocks + 1];
      const int count = kernels->list_blocks(*tile, groups, existing, numbers, keys);
      ASSERT_EQ(count, static_cast<int>(truth.size()));
      std::vector<uint8_t> bits(static_cast<size_t>(groups));
      for (int i = 0; i < count; ++i) {
        ASSERT_EQ(numbers[i], truth[static_cast<size_t>(i)]);
        ASSERT_EQ(keys[i], block_key(tile->blocks[numbers[i]]));
        bits[numbers[i] / 8] |= static_cast<uint8_t>(1 << numbers[i] % 8);
      }
      EXPECT_TRUE(std::equal(bits.begin(), bits.end(), existing));
      EXPECT_EQ(std::count(tile->touched, tile->touched + kTileBlocks, 0), kTileBlocks);
    }
}

// unpack() copies the non-empty bricks of a block in order. It returns the mask of these bricks and
// the number of their voxels.
TEST_F(Blocks, KernelsUnpackThem) {
  for (const Kernels* kernels : all_kernels())
    for (int round = 0; round < 200; ++round) {
      SCOPED_TRACE(round);
      const VoxelBlock block = random_block();
      uint64_t bricks[kBlockBricks];
      const VoxelBlockContent content = kernels->unpack(block, bricks);
      uint32_t mask = 0, voxels = 0;
      for (int i = 0, at = 0; i < kBlockBricks; ++i) {
        if (block.bricks[i] == 0) continue;
        mask |= 1u << i;
        voxels += static_cast<uint32_t>(popcount64(block.bricks[i]));
        ASSERT_EQ(bricks[at++], block.bricks[i]);
      }
      EXPECT_EQ(content.mask, mask);
      EXPECT_EQ(content.voxels, voxels);
    }
}

class Memos : public Blocks {
 protected:
  MemoryBudget budget_{uint64_t{256} << 20};
  PagePool pool_;
  PooledMemory memory_{budget_, pool_};
};

// find() returns the node that was inserted for the block, or null. It never returns the node of
// another block, even if thousands of blocks have the same key. A block is found immediately after
// its insertion, even if the insertion made the memo grow.
TEST_F(Memos, FindWholeBlocksOnly) {
  for (const bool same_key : {false, true}) {
    SCOPED_TRACE(same_key);
    BlockMemo memo(memory_);
    std::vector<VoxelBlock> blocks;
    const auto key_of = [&](const VoxelBlock& block) { return same_key ? 77 : block_key(block); };
    for (uint32_t i = 0; i < 40000; ++i) {
      blocks.push_back(random_block());
      blocks.back().bricks[i % kBlockBricks] |= 1;
      const VoxelBlock& block = blocks.back();
      if (memo.find(key_of(block), block)) continue;
      memo.insert(key_of(block), block, {word(), i, 1, 1});
      const BlockMemo::Node* found = memo.find(key_of(block), block);
      // If insert() made the memo grow, the block moved to the slot of its block_key(), so a lookup
      // with the key 77 of key_of() does not find it.
      if (found == nullptr) found = memo.find(block_key(block), block);
      ASSERT_NE(found, nullptr) << i;
      ASSERT_EQ(found->id, i);
    }
    size_t found_again = 0;
    for (size_t i = 0; i < blocks.size(); ++i)
      if (const BlockMemo::Node* node = memo.find(key_of(blocks[i]), blocks[i])) {
        ++found_again;
        ASSERT_TRUE(equal(blocks[node->id], blocks[i])) << i;
      }
    EXPECT_GT(found_again, same_key ? 0 : blocks.size() / 2);
  }
}

// is_worthwhile() returns false for a while if nearly all blocks are new, because lookups then cost
// more than they save. If most lookups find their block, it always returns true.
TEST_F(Memos, RestWhereTheyDoNotPay) {
  for (const bool repeating : {false, true}) {
    SCOPED_TRACE(repeating);
    BlockMemo memo(memory_);
    int asked = 0;
    for (int tile = 0; tile < 2000; ++tile) {
      if (!memo.is_worthwhile(64)) continue;
      ++asked;
      for (int i = 0; i < (repeating ? 1 : 64); ++i)
        memo.insert(word(), random_block(), {0, 0, 1, 1});
    }
    if (repeating)
      EXPECT_EQ(asked, 2000);
    else
      EXPECT_LT(asked, 300);
    EXPECT_GT(asked, 100);
  }
}

// With a small budget, the memo stops growing and replaces blocks. After its destruction, nothing
// is charged.
TEST_F(Memos, FitSmallBudgets) {
  MemoryBudget small(64 << 10);
  PooledMemory memory{small, pool_};
  {
    BlockMemo memo(memory);
    EXPECT_LE(small.used(), 8u << 10);
    for (uint32_t i = 0; i < 5000; ++i) {
      const VoxelBlock block = random_block();
      memo.insert(block_key(block), block, {0, i, 1, 1});
    }
    EXPECT_LE(small.used(), 16u << 10);
  }
  EXPECT_EQ(small.used(), 0u);
}

}  // namespace
}  // namespace voxdag::cpu
