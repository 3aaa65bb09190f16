// WebP and AVIF images decode to the stored pixels, within the memory that is charged. Without the
// libraries, the error names the format.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "core/base/error.h"
#include "tests/support/error_of.h"
#include "tests/support/modern_image_files.h"
#include "tests/unit/core/image/image_source.h"

namespace voxdag::test {
namespace {

using ::testing::HasSubstr;

// Returns the largest difference of a channel between the image and `pixels`, 8-bit RGBA.
[[maybe_unused]] int difference(const Decoded& image, const std::string& pixels) {
  int largest = 0;
  for (size_t i = 0; i < image.channels.size(); ++i)
    largest = std::max(
        largest, std::abs(image.channels[i] - static_cast<int>(static_cast<uint8_t>(pixels[i]))));
  return largest;
}

#ifdef VOXDAG_HAS_WEBP
// Returns pixels with many areas of different noise, for which the encoder uses different tables.
std::string patchwork(uint32_t width, uint32_t height) {
  std::string pixels = noise(size_t{4} * width * height);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t x = i / 4 % width, y = i / 4 / width, area = x / 32 + 7 * (y / 32);
    pixels[i] = static_cast<char>((pixels[i] & ((1 << area % 6) - 1)) + 31 * area);
  }
  return pixels;
}

TEST(Webp, LosslessImagesAreExact) {
  const std::pair<uint32_t, uint32_t> kSizes[] = {{1, 1}, {31, 17}, {256, 200}, {500, 300}};
  for (const auto& [width, height] : kSizes) {
    const size_t bytes = size_t{4} * width * height;
    std::string few(bytes, '\x7f');  // colors that fit in a palette
    for (size_t i = 0; i < bytes; i += 4) few[i] = static_cast<char>(i / 4 % 13);
    for (const std::string& pixels :
         {noise(bytes), gradient(width, height, 4), few, patchwork(width, height)}) {
      const Decoded image = decode(webp_file(width, height, pixels));
      ASSERT_EQ(image.width, width);
      ASSERT_EQ(image.height, height);
      EXPECT_EQ(image.bits, 8);
      EXPECT_EQ(difference(image, pixels), 0);
    }
  }
}

TEST(Webp, LossyImages) {
  std::string pixels = gradient(120, 90, 4);
  for (const bool is_opaque : {false, true}) {
    for (size_t i = 3; i < pixels.size(); i += 4)
      pixels[i] = is_opaque ? '\xff' : static_cast<char>(i / 4 % 120 * 2);
    const Decoded image = decode(webp_file(120, 90, pixels, false));
    for (uint32_t x = 0; x < 120; ++x) EXPECT_EQ(image.at(x, 45)[3], is_opaque ? 255 : 2 * x);
    if (is_opaque) {
      EXPECT_LE(difference(image, pixels), 12);
    }
  }
}

TEST(Webp, AnimationsAreRefused) {
  EXPECT_THAT(problem_of(animated_webp_file(8, 8, noise(256))), HasSubstr("animated WebP"));
}

TEST(Webp, MemoryIsCharged) {
  for (const bool is_lossless : {false, true}) {
    const std::string file = webp_file(1024, 1024, gradient(1024, 1024, 4), is_lossless);
    EXPECT_EQ(decode(file, 24 << 20).height, 1024u);
    try {
      decode(file, 4 << 20);
      FAIL() << "it fits";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
    }
  }
}

TEST(Webp, TruncatedAnywhere) {
  for (const bool is_lossless : {false, true}) {
    const std::string file = webp_file(64, 48, noise(4 * 64 * 48), is_lossless);
    EXPECT_EQ(problem_of(file), "");
    for (size_t eighth = 1; eighth < 8; ++eighth)
      EXPECT_THAT(problem_of(file.substr(0, file.size() * eighth / 8)), HasSubstr("broken WebP"));
    EXPECT_THAT(problem_of(file.substr(0, file.size() - 20)), HasSubstr("broken WebP"));
  }
}

TEST(Webp, DamagedAnywhere) {
  const std::string file = webp_file(40, 40, patchwork(40, 40));
  for (size_t at = 12; at < file.size(); at += 1 + file.size() / 400) {
    std::string damaged = file;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    EXPECT_NO_THROW(problem_of(damaged)) << at;
  }
}

TEST(Webp, CancellationIsChecked) {
  const std::string file = webp_file(64, 64, noise(4 * 64 * 64));
  EXPECT_EQ(error_of([&] { decode_canceled(file, 0); }).code(), ErrorCode::kCanceled);
}
#else
TEST(Webp, IsNamed) {
  EXPECT_THAT(problem_of(std::string("RIFF\x24\0\0\0WEBPVP8 ", 16)),
              HasSubstr("is a WebP image, whose decoder this voxdag lacks"));
}
#endif

#ifdef VOXDAG_HAS_AVIF
// Images whose planes are green, blue and red, instead of luma and chroma, decode exactly.
TEST(Avif, PlanesOfColorsAreExact) {
  const std::string pixels = noise(4 * 75 * 66);
  const Decoded image = decode(avif_file({.width = 75, .height = 66}, pixels), 64 << 20);
  ASSERT_EQ(image.width, 75u);
  ASSERT_EQ(image.height, 66u);
  EXPECT_EQ(image.bits, 8);
  EXPECT_EQ(difference(image, pixels), 0);
}

// The pixels differ from the library's own conversion only by rounding.
TEST(Avif, EveryKindOfPlanes) {
  const std::string pixels = gradient(75, 66, 4);
  for (const int bits : {8, 10, 12})
    for (const int chroma : {444, 422, 420, 400})
      for (const int matrix : {1, 6, 9})
        for (const bool is_limited : {false, true}) {
          const std::string file = avif_file({.width = 75,
                                              .height = 66,
                                              .bits = bits,
                                              .chroma = chroma,
                                              .matrix = matrix,
                                              .is_limited = is_limited,
                                              .has_alpha = matrix != 6},
                                             pixels);
          Decoded image = decode(file, 64 << 20);
          ASSERT_EQ(image.bits, bits == 8 ? 8 : 16);
          if (bits > 8)
            for (uint16_t& value : image.channels)
              value = static_cast<uint16_t>((value + 128) / 257);
          EXPECT_LE(difference(image, pixels_by_libavif(file)), 1)
              << bits << " bits, " << chroma << ", matrix " << matrix << ", limited " << is_limited;
        }
}

TEST(Avif, GridsOfTiles) {
  const std::string pixels = gradient(256, 64, 4);
  const Decoded image =
      decode(avif_file({.width = 256, .height = 64, .tile_columns = 2}, pixels), 64 << 20);
  ASSERT_EQ(image.width, 256u);
  EXPECT_EQ(difference(image, pixels), 0);
}

TEST(Avif, MemoryIsCharged) {
  const std::string file = avif_file({.width = 1024, .height = 1024}, gradient(1024, 1024, 4));
  EXPECT_EQ(decode(file, 48 << 20).height, 1024u);
  for (const uint64_t memory : {uint64_t{8} << 20, uint64_t{24} << 20}) try {
      decode(file, memory);
      FAIL() << "it fits";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
    }
}

TEST(Avif, TruncatedAnywhere) {
  const std::string file = avif_file({.width = 75, .height = 66}, noise(4 * 75 * 66));
  EXPECT_EQ(problem_of(file, 64 << 20), "");
  for (size_t eighth = 1; eighth < 8; ++eighth)
    EXPECT_THAT(problem_of(file.substr(0, file.size() * eighth / 8), 64 << 20),
                HasSubstr("broken AVIF"));
  EXPECT_THAT(problem_of(file.substr(0, file.size() - 20), 64 << 20), HasSubstr("broken AVIF"));
}

TEST(Avif, DamagedAnywhere) {
  const std::string file = avif_file({.width = 40, .height = 40}, gradient(40, 40, 4));
  for (size_t at = 12; at < file.size(); at += 1 + file.size() / 300) {
    std::string damaged = file;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    EXPECT_NO_THROW(problem_of(damaged, 64 << 20)) << at;
  }
}
#else
TEST(Avif, IsNamed) {
  EXPECT_THAT(problem_of(std::string("\0\0\0\x1c"
                                     "ftypavif\0\0\0\0mif1miaf",
                                     24)),
              HasSubstr("is an AVIF image, whose decoder this voxdag lacks"));
}
#endif

}  // namespace
}  // namespace voxdag::test
