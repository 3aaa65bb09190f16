#include "query/tiles/tile.h"

#include <gmock/gmock.h>

#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/query_files.h"
#include "tests/unit/query/voxel_scene.h"

using namespace voxdag::query;
using voxdag::Error;
using voxdag::ErrorCode;
using voxdag_reader::File;

namespace {

using Words = std::vector<uint32_t>;

// Decodes a tile as docs/format.md describes it, independently of the code that encodes tiles.
struct Tile {
  explicit Tile(Words all) : words(std::move(all)) {
    EXPECT_GE(words.size(), 4u);
    EXPECT_EQ(words[0], 0x31544456u);
    level = words[1] & 255;
    levels = words[1] >> 8 & 255;
    has_bricks = words[1] >> 16;
    leaf_words = has_bricks ? 2 : 4;
    leaves = 4 + size_t{words[2]};
    leaf_count = words[3];
    EXPECT_LE(has_bricks, 1u);
    EXPECT_EQ(words.size(), leaves + leaf_words * leaf_count);
  }
  uint32_t node(size_t at) const { return words.at(4 + at); }
  uint64_t leaf_half(size_t leaf, size_t half) const {
    const size_t at = leaves + leaf * leaf_words + 2 * half;
    return words.at(at) | uint64_t{words.at(at + 1)} << 32;
  }

  Words words;
  uint32_t level, levels, has_bricks;
  size_t leaf_words, leaves, leaf_count;
};

// Returns the word offset of a child according to the file's reader, without the code of the tile
// encoder.
uint64_t child_offset(const File& file, uint32_t level, uint64_t offset, int index) {
  return File::child(file.node(level, offset), index);
}

bool has_child(const File& file, uint32_t level, uint64_t offset, int index) {
  if (level < file.brick_level()) return file.node(level, offset).child_mask >> index & 1;
  for (int x = 0; x < 2; ++x)
    for (int y = 0; y < 2; ++y)
      for (int z = 0; z < 2; ++z)
        if (file.brick(offset) >> File::brick_bit(2 * (index >> 2) + x, 2 * (index >> 1 & 1) + y,
                                                  2 * (index & 1) + z) &
            1)
          return true;
  return false;
}

uint64_t expected_coarse(const File& file, uint32_t level, uint64_t offset) {
  uint64_t mask = 0;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j)
      if (has_child(file, level, offset, i) &&
          has_child(file, level + 1, child_offset(file, level, offset, i), j))
        mask |=
            uint64_t{1} << File::brick_bit((i >> 2) * 2 + (j >> 2), (i >> 1 & 1) * 2 + (j >> 1 & 1),
                                           (i & 1) * 2 + (j & 1));
  return mask;
}

// Compares each node of a tile, from the root down, with the file's node.
class Comparison {
 public:
  Comparison(const File& file, const Tile& tile) : file_(file), tile_(tile) {}

  void run(uint64_t root) {
    compare(0, tile_.level, root);
    EXPECT_EQ(leaves_.size(), tile_.leaf_count);
    // The nodes of a tile are in the order of their levels, without gaps, and equal nodes occur
    // once.
    size_t end = 0;
    uint32_t level = tile_.level;
    for (const auto& [at, node] : nodes_) {
      EXPECT_EQ(at, end);
      EXPECT_GE(node.first, level);
      level = node.first;
      end = at + 1 + static_cast<size_t>(__builtin_popcount(tile_.node(at)));
    }
    EXPECT_EQ(end, tile_.words[2]);
    EXPECT_EQ(addresses_.size(), nodes_.size());
  }

 private:
  void compare(size_t at, uint32_t level, uint64_t offset) {
    const auto [known, is_new] = nodes_.try_emplace(at, level, offset);
    EXPECT_EQ(known->second, std::pair(level, offset));
    if (!is_new) return;
    addresses_.emplace(level, offset);
    const auto node = file_.node(level, offset);
    ASSERT_EQ(tile_.node(at), node.child_mask);
    size_t next = at;
    for (int i = 0; i < 8; ++i) {
      if (!(node.child_mask >> i & 1)) continue;
      const uint32_t child = tile_.node(++next);
      const uint64_t below = child_offset(file_, level, offset, i);
      if (level + 1 < tile_.level + tile_.levels)
        compare(child, level + 1, below);
      else
        compare_leaf(child, level + 1, below);
    }
  }
  void compare_leaf(size_t leaf, uint32_t level, uint64_t offset) {
    ASSERT_LT(leaf, tile_.leaf_count);
    const auto [known, is_new] = leaves_.try_emplace(offset, leaf);
    EXPECT_EQ(known->second, leaf);
    if (!is_new) return;
    EXPECT_EQ(leaf, leaves_.size() - 1) << "leaves are not in order of first use";
    if (tile_.has_bricks) {
      EXPECT_EQ(level, file_.brick_level());
      EXPECT_EQ(tile_.leaf_half(leaf, 0), file_.brick(offset));
    } else {
      EXPECT_EQ(tile_.leaf_half(leaf, 0), offset);
      EXPECT_EQ(tile_.leaf_half(leaf, 1), expected_coarse(file_, level, offset));
    }
  }

  const File& file_;
  const Tile& tile_;
  std::map<size_t, std::pair<uint32_t, uint64_t>> nodes_;
  std::set<std::pair<uint32_t, uint64_t>> addresses_;
  std::map<uint64_t, size_t> leaves_;
};

// Returns the word offsets of all nodes, by level, for the levels above the bricks.
std::vector<std::vector<uint64_t>> all_nodes(const File& file) {
  std::vector<std::vector<uint64_t>> levels(file.brick_level());
  for (uint32_t l = 0; l < file.brick_level(); ++l)
    for (uint64_t at = 0; at < file.level(l).word_count;) {
      levels[l].push_back(at);
      const auto node = file.node(l, at);
      at += 1 + (uint64_t(__builtin_popcount(node.child_mask)) << node.wide);
    }
  return levels;
}

void check_tiles(const QueryFile& scene, uint64_t seed) {
  const File file(scene.path());
  const DagView dag(file);
  oracle::Random random(seed);
  const auto nodes = all_nodes(file);
  for (uint32_t level = 0; level < nodes.size(); ++level)
    for (int i = 0; i < 12; ++i) {
      const auto last = static_cast<int64_t>(nodes[level].size()) - 1;
      const uint64_t offset = nodes[level][static_cast<size_t>(random.between(0, last))];
      for (uint32_t depth = 1; depth <= kMaxTileLevels; ++depth) {
        SCOPED_TRACE("level " + std::to_string(level) + ", word " + std::to_string(offset) +
                     ", depth " + std::to_string(depth));
        const Tile tile(encode_tile(dag, depth, {level, offset}));
        const uint32_t end = tile.level + tile.levels;
        ASSERT_EQ(tile.level, level);
        ASSERT_TRUE(tile.levels >= 1 && tile.levels <= depth && end <= file.brick_level());
        ASSERT_EQ((file.brick_level() - end) % depth, 0u);
        ASSERT_EQ(tile.has_bricks, end == file.brick_level());
        Comparison(file, tile).run(offset);
      }
    }
}

// The example of a tile in docs/format.md is the root tile of the example file in docs/format.md.
TEST(Tile, IsTheExampleOfTheDocuments) {
  const std::string source = VOXDAG_SOURCE_DIR;
  std::ifstream document(source + "/docs/format.md");
  std::string line;
  while (std::getline(document, line) && line != "```words") continue;
  Words expected;
  while (std::getline(document, line) && line != "```") {
    std::istringstream words(line);
    for (std::string word; words >> word;)
      expected.push_back(static_cast<uint32_t>(std::stoul(word, nullptr, 16)));
  }
  const File file(source + "/tests/golden/floor_and_pillar.vdag");
  EXPECT_EQ(encode_tile(DagView(file), 3, {0, 0}), expected);
}

// An independent decoder finds in each tile the nodes of the file below the tile's root.
TEST(Tile, EqualsTheFile) {
  for (const int edge : {8, 16, 64, 128})
    for (const uint64_t seed : {1, 2})
      check_tiles(QueryFile(voxdag::random_voxels(seed, edge)), seed);
}

TEST(Tile, EqualsAFileWithWideLevels) {
  check_tiles(QueryFile(voxdag::random_voxels(3, 128), 50), 3);
}

TEST(Tile, OfABrickOrAnEmptySceneIsRefused) {
  const auto refused = [](const DagView& dag, const TileAddress& root) {
    return voxdag::error_of([&] { encode_tile(dag, 3, root); }).code() == ErrorCode::kNotFound;
  };
  const VoxelScene brick(2, {{1, 2, 3}}), empty(5, {}), scene(5, {{1, 2, 3}});
  EXPECT_TRUE(refused(brick.view(), {0, 0}));
  EXPECT_TRUE(refused(empty.view(), {0, 0}));
  EXPECT_TRUE(refused(scene.view(), {3, 0}));
  EXPECT_TRUE(refused(scene.view(), {~0u, 0}));
  EXPECT_TRUE(refused(scene.view(), {0, 2}));
  EXPECT_TRUE(refused(scene.view(), {0, ~uint64_t{0}}));
  EXPECT_FALSE(encode_tile(scene.view(), 3, {2, 0}).empty());
  for (const uint32_t depth : {0u, kMaxTileLevels + 1})
    EXPECT_EQ(voxdag::error_of([&] {
                encode_tile(scene.view(), depth, {0, 0});
              }).code(),
              ErrorCode::kInvalidInput);
}

// True if encode_tile() makes a tile for the address; false if it fails. The decoder checks the
// tile's size.
bool has_tile(const DagView& dag, uint32_t depth, const TileAddress& root) {
  try {
    const Tile tile(encode_tile(dag, depth, root));
    return true;
  } catch (const Error& error) {
    EXPECT_THAT(error.code(), testing::AnyOf(ErrorCode::kNotFound, ErrorCode::kCorrupt));
    return false;
  }
}

// For any word offset, encode_tile() gives a tile or an error. It always gives a tile if a node is
// at this offset.
TEST(Tile, AnyOffsetIsAnsweredOrRefused) {
  const QueryFile scene(voxdag::random_voxels(5, 64));
  const File file(scene.path());
  const DagView dag(file);
  const auto nodes = all_nodes(file);
  size_t refused = 0;
  for (uint32_t level = 0; level < nodes.size(); ++level) {
    const std::set<uint64_t> is_node(nodes[level].begin(), nodes[level].end());
    for (uint64_t at = 0; at < file.level(level).word_count + 3; ++at) {
      const bool has = has_tile(dag, 3, {level, at});
      refused += !has;
      EXPECT_TRUE(has || !is_node.contains(at));
      EXPECT_FALSE(has && at >= file.level(level).word_count);
    }
  }
  EXPECT_GT(refused, 50u);
}

// For a file with damaged words, encode_tile() gives a tile or an error.
TEST(Tile, ADamagedFileIsAnError) {
  std::set<VoxelScene::Voxel> voxels;
  oracle::Random random(7);
  for (int i = 0; i < 300; ++i)
    voxels.insert({random.between(0, 63), random.between(0, 63), random.between(0, 63)});
  const VoxelScene whole(6, voxels);
  size_t refused = 0;
  for (int i = 0; i < 3000; ++i) {
    VoxelScene scene = whole;
    const auto level = static_cast<uint32_t>(random.between(0, 4));
    Words& words = scene.level_words(level);
    uint32_t& word =
        words[static_cast<size_t>(random.between(0, static_cast<int64_t>(words.size()) - 1))];
    word = random.between(0, 1) ? 0u : word ^ 1u << random.between(0, 31);
    for (const uint32_t depth : {1u, 2u, 5u}) refused += !has_tile(scene.view(), depth, {0, 0});
  }
  EXPECT_GT(refused, 1000u);
}

}  // namespace
