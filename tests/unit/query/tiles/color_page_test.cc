// Tests color pages. A decoder of pages and a decoder of the file's color section, both written
// from docs/format.md, must find the same cells and colors on each level.
#include "query/tiles/color_page.h"

#include <gtest/gtest.h>

#include <optional>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "tests/support/error_of.h"
#include "tests/unit/core/format/color/colored_files.h"

namespace voxdag {
namespace {

using query::ColorPageAddress;
using query::ColorPages;
using Color3 = SectionDecoder::Color3;
using Words = std::vector<uint32_t>;

// Decodes color `i` of a color block, which has 16 bytes, as docs/format.md describes it.
Color3 color_in_block(const uint32_t* block, uint32_t i) {
  const auto byte = [&](uint32_t at) { return block[at / 4] >> 8 * (at % 4) & 255; };
  Color3 color;
  const auto mix = [](uint32_t a, uint32_t b, uint32_t w, uint32_t top) {
    return static_cast<int>((a * (top - w) + b * w + top / 2) / top);
  };
  if ((block[0] & 0xffff) == 0) {
    const uint32_t w = byte(8 + i / 4) >> 2 * (i % 4) & 3;
    for (uint32_t c = 0; c < 3; ++c) color[c] = mix(byte(4 - c), byte(7 - c), w, 3);
    return color;
  }
  uint32_t w = 0;
  for (uint32_t bit = 0; bit < 3; ++bit) {
    const uint32_t at = 32 + 3 * i + bit;
    w |= (byte(at / 8) >> at % 8 & 1) << bit;
  }
  const uint32_t shifts[] = {11, 5, 0}, bits[] = {5, 6, 5};
  for (size_t c = 0; c < 3; ++c) {
    const auto end = [&](uint32_t value) {
      const uint32_t v = value >> shifts[c] & ((1u << bits[c]) - 1);
      return v << (8 - bits[c]) | v >> (2 * bits[c] - 8);
    };
    color[c] = mix(end(block[0] & 0xffff), end(block[0] >> 16), w, 7);
  }
  return color;
}

// Returns the colors of the cells of a page, by the cells' Morton codes within the page.
std::map<uint32_t, Color3> decode(const Words& page) {
  std::map<uint32_t, Color3> colors;
  const uint32_t count = page.at(0) & 0x3ff, skip = page[0] >> 16 & 31;
  const bool single = page[0] >> 24 & 1;
  EXPECT_EQ(page[0] & 0xfee0fc00, 0u);
  if (count == 0) {
    EXPECT_EQ(page, Words{0});
    return colors;
  }
  EXPECT_EQ(page.size(), 17 + (single ? count : (skip + count + 31) / 32 * 4));
  uint32_t rank = 0;
  for (uint32_t code = 0; code < 512; ++code) {
    if (!(page[1 + code / 32] >> code % 32 & 1)) continue;
    const uint32_t i = skip + rank++;
    const uint32_t word = single ? page.at(17 + i) : 0;
    colors[code] = single ? Color3{int(word & 255), int(word >> 8 & 255), int(word >> 16)}
                          : color_in_block(&page.at(17 + i / 32 * 4), i % 32);
  }
  EXPECT_EQ(rank, count);
  return colors;
}

class ColorPagesTest : public testing::Test {
 protected:
  void write(const ColoredScene& scene, bool with_colors = true) {
    write_colored(path_, scene, with_colors);
    file_ = open_global_file(path_);
    dag_.emplace(*file_);
    pages_.emplace(*file_, *dag_);
  }
  ErrorCode refusal(const ColorPageAddress& address) {
    return error_of([&] { pages_->encode(address); }).code();
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("colored.vdag");
  std::unique_ptr<voxdag_reader::File> file_;
  std::optional<query::DagView> dag_;
  std::optional<ColorPages> pages_;
};

TEST_F(ColorPagesTest, HaveTheColorsOfAllLevels) {
  const uint32_t sizes[][2] = {{2, 2}, {5, 3}, {7, 7}, {8, 8}, {12, 10}, {14, 13}, {20, 20}};
  for (const auto& [levels, color_levels] : sizes) {
    const ColoredScene scene{levels, color_levels,
                             random_codes(levels * 10 + 1, levels, levels < 4 ? 20 : 1500),
                             smooth_colors(color_levels, 3)};
    write(scene);
    const ByteString bytes = read_bytes(path_);
    const SectionDecoder decoder(bytes, scene);
    size_t cells = 0;
    for (uint32_t level = 0; level <= color_levels; ++level) {
      std::set<uint64_t> roots;
      for (const uint64_t code : scene.cells(level)) roots.insert(code >> 9);
      for (const uint64_t root : roots) {
        uint32_t x, y, z;
        morton_decode(root, x, y, z);
        for (const auto& [code, color] : decode(pages_->encode({level, {x, y, z}}))) {
          const auto expected = decoder.colors().find({level, root << 9 | code});
          ASSERT_NE(expected, decoder.colors().end()) << level << " " << root << " " << code;
          ASSERT_EQ(color, expected->second) << level << " " << root << " " << code;
          ++cells;
        }
      }
    }
    EXPECT_EQ(cells, decoder.colors().size());
  }
}

TEST_F(ColorPagesTest, OfWhatIsNotThereAreEmptyOrRefused) {
  const ColoredScene scene{8, 6, {0, 1, 1 << 12}, smooth_colors(6, 0)};
  write(scene);
  EXPECT_EQ(pages_->encode({6, {7, 7, 7}}), Words{0});
  EXPECT_EQ(pages_->encode({6, {0, 0, 0}})[0] & 0x3ff, 2u);
  for (const ColorPageAddress& address : {ColorPageAddress{7, {0, 0, 0}},
                                          {~0u, {0, 0, 0}},
                                          {6, {8, 0, 0}},
                                          {6, {0, ~0ull, 0}},
                                          {2, {0, 0, 1}},
                                          {0, {1, 0, 0}},
                                          {3, {0, 1ull << 61, 0}}})
    EXPECT_EQ(refusal(address), ErrorCode::kNotFound) << address.level;
  write(scene, false);
  EXPECT_EQ(refusal({6, {0, 0, 0}}), ErrorCode::kNotFound);
}

// Encoding pages of a color section that does not match the DAG gives an error or wrong colors, but
// never crashes.
TEST_F(ColorPagesTest, OfDamagedColorsAreErrors) {
  const ColoredScene scene{8, 8, random_codes(3, 8, 1500), smooth_colors(8, 3)};
  write_colored(path_, scene);
  const ByteString whole = read_bytes(path_);
  uint64_t section = 0, size = 0;
  std::memcpy(&section, whole.data() + 1152 + 8, 8);
  std::memcpy(&size, whole.data() + 1152 + 16, 8);
  oracle::Random random(5);
  int refused = 0;
  for (int i = 0; i < 60; ++i) {
    ByteString bytes = whole;
    // The tier table is the last 64 bytes of the section. The directories are before it.
    for (int n = 0; n < 4; ++n)
      bytes[section + size - static_cast<uint64_t>(random.between(65, 1500))] ^=
          static_cast<char>(random.between(1, 255));
    write_bytes(path_, bytes);
    const auto file = open_global_file(path_);
    const query::DagView dag(*file);
    ColorPages pages(*file, dag);
    for (const uint64_t voxel : scene.voxels) {
      uint32_t x, y, z;
      morton_decode(voxel >> 9, x, y, z);
      try {
        pages.encode({8, {x, y, z}});
      } catch (const Error& error) {
        EXPECT_TRUE(error.is_corruption()) << error.message();
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace voxdag
