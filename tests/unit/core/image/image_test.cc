// Images of every kind decode to the stored pixels. Images that are broken, or that declare too
// large sizes, do no harm.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <span>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/image/png_writer.h"
#include "tests/support/error_of.h"
#include "tests/support/image_files.h"
#include "tests/unit/core/image/image_source.h"

namespace voxdag::test {
namespace {

using ::testing::HasSubstr;

void expect_gradient(const std::string& file, uint32_t width, uint32_t height,
                     uint32_t components) {
  const Decoded image = decode(file);
  ASSERT_EQ(image.width, width);
  ASSERT_EQ(image.height, height);
  EXPECT_EQ(image.bits, 8);
  const std::string pixels = gradient(width, height, components);
  int worst = 0;
  for (size_t i = 0; i < size_t{width} * height; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const size_t stored = components == 1 ? i : 3 * i + c;
      worst = std::max(
          worst, std::abs(static_cast<uint8_t>(pixels[stored]) - int{image.channels[4 * i + c]}));
    }
    ASSERT_EQ(image.channels[4 * i + 3], 255);
  }
  EXPECT_LE(worst, 8);
}

TEST(Jpeg, BaselineProgressiveAndGray) {
  for (const bool is_progressive : {false, true}) {
    expect_gradient(jpeg_file(67, 45, 3, gradient(67, 45, 3), is_progressive), 67, 45, 3);
    expect_gradient(jpeg_file(33, 70, 1, gradient(33, 70, 1), is_progressive), 33, 70, 1);
  }
}

TEST(Jpeg, CmykIsRefused) {
  EXPECT_THAT(problem_of(jpeg_file(16, 16, 4, gradient(16, 16, 4))), HasSubstr("CMYK"));
}

// A scan of a few hundred bytes costs a pass over all coefficients, so the number of scans is
// limited.
TEST(Jpeg, ManyScans) {
  const std::string pixels = gradient(48, 40, 3);
  expect_gradient(jpeg_of_scans(48, 40, pixels, 1), 48, 40, 3);
  expect_gradient(jpeg_of_scans(48, 40, pixels, 400), 48, 40, 3);
  EXPECT_THAT(problem_of(jpeg_of_scans(48, 40, pixels, 600)), HasSubstr("over 500 scans"));
}

// Kinds of JPEG that need other decoders are refused. The frame header gives the kind.
TEST(Jpeg, OtherFrames) {
  const std::string file = jpeg_file(16, 16, 3, gradient(16, 16, 3));
  const size_t frame = file.find("\xff\xc0");
  ASSERT_NE(frame, std::string::npos);
  const auto with = [&](size_t at, const std::string& bytes) {
    std::string changed = file;
    return changed.replace(frame + at, bytes.size(), bytes);
  };
  EXPECT_EQ(problem_of(with(1, "\xc0")), "");
  EXPECT_THAT(problem_of(with(1, "\xc9")), HasSubstr("arithmetic"));
  EXPECT_THAT(problem_of(with(1, "\xc3")), HasSubstr("JPEG"));                // lossless
  EXPECT_THAT(problem_of(with(1, "\xc5")), HasSubstr("JPEG"));                // differential
  EXPECT_THAT(problem_of(with(4, "\x0c")), HasSubstr("JPEG"));                // 12 bits
  EXPECT_THAT(problem_of(with(5, std::string(2, '\0'))), HasSubstr("JPEG"));  // height comes later
}

// A baseline JPEG is decoded row by row, so its memory does not depend on its height. A progressive
// JPEG needs memory for all coefficients.
TEST(Jpeg, MemoryOfProgressiveImages) {
  const std::string pixels = gradient(1024, 1024, 1);
  constexpr uint64_t kMemory = 2400 << 10;
  EXPECT_EQ(decode(jpeg_file(1024, 1024, 1, pixels), kMemory).height, 1024u);
  try {
    decode(jpeg_file(1024, 1024, 1, pixels, true), kMemory);
    FAIL() << "it fits";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
  }
}

// Files that declare huge sizes are refused. The frame header has the size at byte 5.
TEST(Jpeg, HugeSizes) {
  std::string file = jpeg_file(16, 16, 3, gradient(16, 16, 3), true);
  const size_t frame = file.find("\xff\xc2");
  ASSERT_NE(frame, std::string::npos);
  file.replace(frame + 5, 4, "\xff\xff\xff\xff");
  EXPECT_THAT(problem_of(file), HasSubstr("65500"));  // the library's own limit
  file.replace(frame + 5, 4, "\xff\x01\xff\x01");
  EXPECT_THAT(problem_of(file), HasSubstr("65281 x 65281 pixels"));
  file.replace(frame + 5, 4, "\x40\x10\x3f\xf0");  // just below 2^28 pixels, which need over 1 GiB
  EXPECT_THROW(decode(file), Error);
}

TEST(Png, EveryColorTypeOf8And16Bits) {
  const std::string bytes = noise(2 * 4 * 7 * 5);
  for (const int depth : {8, 16})
    for (const auto& [type, channels] : {std::pair{0, 1}, {2, 3}, {4, 2}, {6, 4}})
      for (const bool is_interlaced : {false, true}) {
        const size_t pixel_bytes = static_cast<size_t>(channels * depth / 8);
        const Decoded image = decode(
            png_file({7, 5, depth, type, "", is_interlaced}, bytes.substr(0, pixel_bytes * 35)));
        ASSERT_EQ(image.bits, depth);
        const uint16_t full = depth == 8 ? 255 : 65535;
        for (uint32_t i = 0; i < 35; ++i) {
          const auto stored = [&](size_t c) {
            const auto* const p = reinterpret_cast<const uint8_t*>(&bytes[pixel_bytes * i]);
            return static_cast<uint16_t>(depth == 8 ? p[c] : p[2 * c] << 8 | p[2 * c + 1]);
          };
          const uint16_t red = stored(0);
          const Pixel expected = type == 0   ? Pixel{red, red, red, full}
                                 : type == 4 ? Pixel{red, red, red, stored(1)}
                                 : type == 2 ? Pixel{red, stored(1), stored(2), full}
                                             : Pixel{red, stored(1), stored(2), stored(3)};
          ASSERT_EQ(image.at(i % 7, i / 7), expected) << depth << " bits, type " << type;
        }
      }
}

TEST(Png, PaletteWithTransparency) {
  const std::string palette = png_chunk("PLTE", std::string("\xff\0\0\0\x80\0\x01\x02\x03", 9));
  const std::string alpha = png_chunk("tRNS", "\x10\x20");
  // The four pixels have two bits each: 0, 1, 2, 0.
  const Decoded image = decode(png_file({4, 1, 2, 3, palette + alpha}, "\x18"));
  EXPECT_EQ(image.bits, 8);
  EXPECT_EQ(image.at(0, 0), (Pixel{255, 0, 0, 16}));
  EXPECT_EQ(image.at(1, 0), (Pixel{0, 128, 0, 32}));
  EXPECT_EQ(image.at(2, 0), (Pixel{1, 2, 3, 255}));
  EXPECT_EQ(image.at(3, 0), (Pixel{255, 0, 0, 16}));
}

// Pixels with an index beyond the palette are black. A missing palette or one with too many entries
// is an error.
TEST(Png, BrokenPalettes) {
  const std::string palette = png_chunk("PLTE", "abcdef");
  const Decoded image = decode(png_file({2, 1, 8, 3, palette}, "\x01\xff"));
  EXPECT_EQ(image.at(0, 0), (Pixel{'d', 'e', 'f', 255}));
  EXPECT_EQ(image.at(1, 0), (Pixel{0, 0, 0, 255}));
  EXPECT_THAT(problem_of(png_file({2, 1, 8, 3, ""}, "\x01\x02")), HasSubstr("broken PNG"));
  const std::string long_one = png_chunk("PLTE", std::string(768 * 100, 'a'));
  EXPECT_THAT(problem_of(png_file({2, 1, 8, 3, long_one}, "\x01\x02")), HasSubstr("broken PNG"));
}

TEST(Png, TransparentColor) {
  const Decoded rgb = decode(png_file(
      {2, 1, 8, 2, png_chunk("tRNS", std::string("\0\1\0\2\0\3", 6))}, "\x01\x02\x03\x01\x02\x04"));
  EXPECT_EQ(rgb.at(0, 0), (Pixel{1, 2, 3, 0}));
  EXPECT_EQ(rgb.at(1, 0), (Pixel{1, 2, 4, 255}));
  // The two pixels have one bit each. The first is 0, black; the second is 1, transparent white.
  const Decoded gray =
      decode(png_file({2, 1, 1, 0, png_chunk("tRNS", std::string("\0\1", 2))}, "\x40"));
  EXPECT_EQ(gray.at(0, 0), (Pixel{0, 0, 0, 255}));
  EXPECT_EQ(gray.at(1, 0), (Pixel{255, 255, 255, 0}));
}

// Gamma and color profiles of any size are ignored.
TEST(Png, WhatIsIgnored) {
  const std::string chunks =
      png_chunk("gAMA", big_endian(100000)) + png_chunk("iCCP", noise(1 << 20));
  EXPECT_EQ(decode(png_file({1, 1, 8, 6, chunks}, "\x0a\x14\x1e\x28")).at(0, 0),
            (Pixel{10, 20, 30, 40}));
}

TEST(Png, Writer) {
  const std::string pixels = noise(3 * 13 * 9);
  const std::span rgb(reinterpret_cast<const uint8_t*>(pixels.data()), pixels.size());
  const Decoded image = decode(encode_png(13, 9, rgb));
  ASSERT_EQ(image.width, 13u);
  ASSERT_EQ(image.height, 9u);
  for (uint32_t i = 0; i < 13 * 9; ++i)
    EXPECT_EQ(image.at(i % 13, i / 13), (Pixel{rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2], 255}));
}

TEST(Png, HugeSizes) {
  const std::string file = png_file({2, 2, 8, 6, ""}, noise(16));
  const auto claiming = [&](uint32_t width, uint32_t height, bool is_interlaced) {
    const std::string rest = {8, 6, 0, 0, static_cast<char>(is_interlaced)};
    return file.substr(0, 8) + png_chunk("IHDR", big_endian(width) + big_endian(height) + rest) +
           file.substr(33);
  };
  EXPECT_THAT(problem_of(claiming(1u << 31, 2, false)), HasSubstr("broken PNG"));
  EXPECT_THAT(problem_of(claiming(0x7fffffff, 2, false)), HasSubstr("2147483647 x 2 pixels"));
  EXPECT_THAT(problem_of(claiming(65535, 65535, false)), HasSubstr("65535 x 65535 pixels"));
  EXPECT_THAT(problem_of(claiming(0, 2, false)), HasSubstr("PNG"));
  // The size is within the limits, but the file has fewer pixels.
  EXPECT_THAT(problem_of(claiming(16384, 16384, false)), HasSubstr("broken PNG"));
  EXPECT_THROW(decode(claiming(16384, 16384, true)), Error);
}

// Surplus rows after the image, and compressed texts, need little memory, even if they expand to
// megabytes, a thousand times their size in the file.
TEST(Png, DecompressionBombs) {
  std::string rows = png_file({2, 512, 8, 6, ""}, std::string(4 << 20, '\0'));
  rows.replace(8, 25,
               png_chunk("IHDR", big_endian(2) + big_endian(2) + std::string("\x8\x6\0\0\0", 5)));
  EXPECT_NO_THROW(problem_of(rows, 2 << 20));
  const std::string packed = rows.substr(41, rows.size() - 57);
  const std::string text = png_chunk("zTXt", std::string("a\0\0", 3) + packed);
  EXPECT_EQ(decode(png_file({1, 1, 8, 6, text}, "abcd"), 2 << 20).at(0, 0),
            (Pixel{'a', 'b', 'c', 'd'}));
}

// The error for a format without a decoder names the format and a command that converts it.
TEST(Images, OtherFormats) {
  const std::string start(12, '.');
  const std::pair<std::string, const char*> kFormats[] = {
      {"\xabKTX 20\xbb\r\n\x1a\n", "a KTX2 image"},
      {"\xabKTX 11\xbb\r\n\x1a\n", "a KTX image"},
      {"DDS |" + start, "a DDS image"},
      {"GIF89a" + start, "a GIF image"},
      {"BM" + start, "a BMP image"},
      {std::string("II*\0", 4) + start, "a TIFF image"},
      {std::string("MM\0*", 4) + start, "a TIFF image"},
      {"#?RADIANCE\n" + start, "a Radiance HDR image"},
      {"\x76\x2f\x31\x01" + start, "an OpenEXR image"},
      {"8BPS" + start, "a Photoshop image"},
      {std::string("\0\0\0\x18"
                   "ftypheic\0\0\0\0mif1heic",
                   24),
       "an HEIF image"},
      {"<svg xmlns", "an SVG drawing"}};
  for (const auto& [bytes, name] : kFormats) {
    const std::string problem = problem_of(bytes);
    EXPECT_THAT(problem, HasSubstr("is " + std::string(name) + ", expected PNG, JPEG"));
    EXPECT_THAT(problem, HasSubstr("(convert ")) << name;
  }
  EXPECT_THAT(problem_of("\xabKTX 20"), HasSubstr("gltf-transform ktxdecompress IN.glb OUT.glb"));
  EXPECT_THAT(problem_of("0123456789"), HasSubstr("unknown format"));
  EXPECT_THAT(problem_of(""), HasSubstr("empty"));
}

TEST(Images, GitLfsPointers) {
  EXPECT_THAT(problem_of("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n"),
              HasSubstr("is a Git LFS pointer, not the image itself"));
}

TEST(Images, MemoryIsRefused) {
  for (const std::string& file :
       {png_file({2, 2, 8, 6, ""}, noise(16)), jpeg_file(16, 16, 3, gradient(16, 16, 3))}) {
    try {
      decode(file, 64 << 10);
      FAIL() << "it fits";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
    }
  }
}

// Reading only the size takes no memory for rows, also for images that are decoded in one piece.
TEST(Images, SizeAlone) {
  const std::string pixels = noise(4 << 20);
  for (const std::string& file : {png_file({1024, 1024, 8, 6, "", true}, pixels),
                                  jpeg_file(1024, 1024, 1, gradient(1024, 1024, 1), true)}) {
    StringSource bytes(file);
    MemoryBudget budget(uint64_t{2} << 20);
    const auto image = open_image(bytes, budget, ImageUse::kSize);
    EXPECT_EQ(image->width(), 1024u);
    EXPECT_EQ(image->height(), 1024u);
    EXPECT_LT(budget.peak(), uint64_t{5} << 18);
  }
}

TEST(Images, TruncatedAnywhere) {
  for (const std::string& file :
       {png_file({31, 17, 8, 6, ""}, noise(4 * 31 * 17)),
        png_file({31, 17, 16, 2, "", true}, noise(6 * 31 * 17)),
        jpeg_file(64, 48, 3, noise(3 * 64 * 48)), jpeg_file(64, 48, 3, noise(3 * 64 * 48), true)}) {
    EXPECT_EQ(problem_of(file), "");
    for (size_t eighth = 0; eighth < 8; ++eighth)
      EXPECT_NE(problem_of(file.substr(0, file.size() * eighth / 8)), "") << eighth;
    EXPECT_NE(problem_of(file.substr(0, file.size() - 20)), "");
  }
}

// A file with one changed byte gives pixels or an error message, and nothing else.
TEST(Images, DamagedAnywhere) {
  for (const std::string& file :
       {png_file({9, 7, 8, 6, "", true}, noise(4 * 63)), jpeg_file(24, 16, 3, noise(3 * 24 * 16)),
        jpeg_file(24, 16, 3, noise(3 * 24 * 16), true)}) {
    int broken = 0;
    for (size_t i = 0; i < file.size(); ++i) {
      std::string damaged = file;
      damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
      try {
        broken += problem_of(damaged, 8 << 20) != "";
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
      }
    }
    EXPECT_GT(broken, 20);
  }
}

// A small file can take minutes to decode, so decoders stop when the token is canceled, even while
// they decode scans or rows for which they read no more bytes of the file.
TEST(Images, CancellationStopsDecoders) {
  const uint32_t edge = 512;
  PngFormat plain, interlaced;
  plain.width = plain.height = interlaced.width = interlaced.height = edge;
  interlaced.is_interlaced = true;
  const std::string files[] = {png_file(plain, std::string(size_t{4} * edge * edge, 'x')),
                               png_file(interlaced, std::string(size_t{4} * edge * edge, 'x')),
                               jpeg_file(edge, edge, 3, gradient(edge, edge, 3)),
                               jpeg_of_scans(edge, edge, gradient(edge, edge, 3), 100)};
  for (const std::string& file : files)
    for (const size_t cancel_at : {size_t{0}, size_t{1000}, file.size() / 2}) {
      SCOPED_TRACE(testing::Message() << (&file - files) << " at " << cancel_at);
      EXPECT_EQ(error_of([&] { decode_canceled(file, cancel_at); }).code(), ErrorCode::kCanceled);
    }
}

// Errors of the source pass through the decoders, and no memory remains charged.
TEST(Images, ErrorsOfTheSource) {
  struct Failing : StringSource {
    using StringSource::StringSource;
    size_t read(std::span<std::byte> out) override {
      if (at >= kImageHeadBytes) throw Error(ErrorCode::kIo, "disk");
      return StringSource::read(out);
    }
  };
  for (const std::string& file :
       {png_file({9, 9, 8, 6, ""}, noise(4 * 81)), jpeg_file(16, 16, 3, gradient(16, 16, 3))}) {
    MemoryBudget budget(16 << 20);
    Failing source(file);
    EXPECT_THROW(
        {
          const auto image = open_image(source, budget);
          std::vector<std::byte> row(size_t{4} * image->width());
          for (uint32_t y = 0; y < image->height(); ++y) image->read_row(row);
        },
        Error);
    EXPECT_EQ(budget.used(), 0u);
  }
}

}  // namespace
}  // namespace voxdag::test
