// In a file with flipped bits, each tile and color page has its original contents or gives an
// error.
#include <gtest/gtest.h>

#include <cstring>

#include "core/format/global/checked_blocks.h"
#include "core/format/global/open_global.h"
#include "query/tiles/color_page.h"
#include "query/tiles/tile.h"
#include "tests/support/flip_bits.h"
#include "tests/unit/core/format/color/colored_files.h"

namespace voxdag {
namespace {

using Words = std::vector<uint32_t>;

constexpr uint32_t kLevels = 9, kColorLevels = 9, kDepth = 3;

// A file of several checksum blocks of 64 KiB. Tests encode up to 60 of its tiles, of three levels
// each, and some of its color pages.
class DamagedBlocks : public testing::Test {
 protected:
  void SetUp() override {
    write_colored(path_, scene_);
    whole_ = read_bytes(path_);
    const auto file = open_global_file(path_);
    for (const uint32_t level : {0u, 1u, 4u})
      for (uint64_t at = 0; at < file->level(level).word_count && tiles_.size() < 60;) {
        tiles_.push_back({level, at});
        at += 1 + static_cast<uint64_t>(__builtin_popcount(file->node(level, at).child_mask));
      }
    for (size_t i = 0; i < scene_.voxels.size(); i += scene_.voxels.size() / 60)
      for (const uint32_t level : {3u, 8u, 9u}) {
        uint32_t x, y, z;
        morton_decode(scene_.voxels[i] >> 3 * (kLevels - level + 3), x, y, z);
        pages_.push_back({level, {x, y, z}});
      }
    ASSERT_GT(file->checksum_table_offset(), 4 * 65536u);
  }

  // Encodes all tiles, then all pages. A tile or page for which DamagedBlock is thrown gets empty
  // contents. Any other exception fails the test.
  std::vector<Words> read(bool with_checks) {
    const auto file = open_global_file(path_);
    const query::DagView dag(*file);
    const CheckedBlocks blocks(*file);
    const CheckedBlocks* const checks = with_checks ? &blocks : nullptr;
    query::ColorPages pages(*file, dag, checks);
    std::vector<Words> all;
    const auto add = [&](auto make) {
      try {
        all.push_back(make());
      } catch (const DamagedBlock&) {
        all.push_back({});
      }
    };
    for (const auto& tile : tiles_)
      add([&] { return query::encode_tile(dag, kDepth, tile, checks); });
    for (const auto& page : pages_) add([&] { return pages.encode(page); });
    return all;
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_.file("colored.vdag");
  const ColoredScene scene_{kLevels, kColorLevels, random_codes(11, kLevels, 60000),
                            smooth_colors(kColorLevels, 3)};
  ByteString whole_;
  std::vector<query::TileAddress> tiles_;
  std::vector<query::ColorPageAddress> pages_;
};

TEST_F(DamagedBlocks, AreFoundBeforeTheyAreUsed) {
  const std::vector<Words> expected = read(false);
  EXPECT_EQ(read(true), expected);
  oracle::Random random(3);
  size_t refused = 0, made = 0;
  uint64_t table = 0;
  std::memcpy(&table, whole_.data() + global_layout::kTableOffsetAt, sizeof table);
  for (int i = 0; i < 40; ++i) {
    ByteString bytes = whole_;
    const auto at = static_cast<size_t>(random.between(4096, static_cast<int64_t>(table) - 1));
    bytes[at] ^= static_cast<char>(1 << random.between(0, 7));
    write_bytes(path_, bytes);
    const std::vector<Words> found = read(true);
    for (size_t n = 0; n < found.size(); ++n) {
      (found[n].empty() ? refused : made) += 1;
      ASSERT_TRUE(found[n].empty() || found[n] == expected[n]) << "byte " << at << ", part " << n;
    }
  }
  EXPECT_GT(refused, 100u);
  EXPECT_GT(made, 1000u);
}

// The result that a block is damaged is not stored: the block is verified again at its next use, so
// a repaired file works without a restart.
TEST_F(DamagedBlocks, AreComparedUntilTheyAreIntact) {
  const auto file = open_global_file(path_);
  const CheckedBlocks blocks(*file);
  const unsigned char* const second = file->data() + 4096 + 65536;
  const auto flip = [&](uint64_t at) { flip_bits(path_, at, 1); };
  flip(4096 + 65536 + 17);
  EXPECT_NO_THROW(blocks.expect_intact(second - 65536, 65536));
  EXPECT_THROW(blocks.expect_intact(second, 1), DamagedBlock);
  EXPECT_THROW(blocks.expect_intact(second - 1, 2), DamagedBlock);
  EXPECT_THROW(blocks.expect_intact(second - 1, 65540), DamagedBlock);
  EXPECT_NO_THROW(blocks.expect_intact(second, 0));
  flip(4096 + 65536 + 17);
  EXPECT_NO_THROW(blocks.expect_intact(second - 1, 65540));
  const uint64_t table = file->checksum_table_offset();
  EXPECT_NO_THROW(blocks.expect_intact(file->data() + table - 1, 1)) << "the last, a part of one";
}

}  // namespace
}  // namespace voxdag
