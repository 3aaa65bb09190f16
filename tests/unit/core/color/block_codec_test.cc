#include "core/color/blocks/block_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/integers.h"
#include "tests/oracle/scenes.h"

namespace voxdag {
namespace {

// Returns blocks of every size with random colors, colors near a line, colors near a point, two
// colors, and one color.
std::vector<std::vector<Color>> many_blocks(size_t count) {
  oracle::Random random(3);
  const auto byte = [&] { return static_cast<int>(random.between(0, 255)); };
  std::vector<std::vector<Color>> blocks;
  for (size_t i = 0; i < count; ++i) {
    std::vector<Color> block(i % 3 == 0 ? 1 + i / 3 % kBlockCells : kBlockCells);
    int start[3], along[3];
    for (int c = 0; c < 3; ++c) {
      start[c] = byte();
      along[c] = byte() - start[c];
    }
    const int noise = i % 7 == 0 ? 255 : i % 7 == 1 ? 0 : 1 << i % 6;
    const int places = i % 5 == 0 ? 1 : i % 5 == 1 ? 0 : 255;
    for (Color& color : block) {
      const int at = static_cast<int>(random.between(0, places));
      for (int c = 0; c < 3; ++c) {
        const int value = start[c] + (places == 0 ? 0 : along[c] * at / places) +
                          static_cast<int>(random.between(-noise, noise));
        color.rgb[static_cast<size_t>(c)] = static_cast<uint8_t>(std::clamp(value, 0, 255));
      }
      color.alpha = static_cast<uint8_t>(byte());
    }
    blocks.push_back(std::move(block));
  }
  return blocks;
}

// The encoder must always write the same bytes.
TEST(BlockCodec, GoldenDigest) {
  uint64_t digest = 0;
  for (const auto& block : many_blocks(4000))
    for (const std::byte byte : encode_block_portable(block.data(), block.size()))
      digest = mix_bits(digest ^ static_cast<uint64_t>(byte));
  EXPECT_EQ(digest, 16205906546772348724u);
}

TEST(BlockCodec, Avx2EncodesAsPortableCodeDoes) {
  const EncodeBlock encode = encode_block_avx2();
  if (!encode) GTEST_SKIP() << "this machine has no AVX2";
  size_t flat = 0, of_mode_a = 0, of_mode_b = 0;
  for (const auto& block : many_blocks(20000)) {
    const ColorBlock expected = encode_block_portable(block.data(), block.size());
    ASSERT_EQ(encode(block.data(), block.size()), expected) << block.size() << " colors";
    const bool is_b = expected[0] == std::byte{0} && expected[1] == std::byte{0};
    const bool is_flat = std::equal(&expected[2], &expected[5], &expected[5]);
    ++(is_flat && is_b ? flat : is_b ? of_mode_b : of_mode_a);
  }
  for (const size_t count : {flat, of_mode_a, of_mode_b}) EXPECT_GT(count, 500u);
}

}  // namespace
}  // namespace voxdag
