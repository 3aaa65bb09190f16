// Reads LAS files made by the tests: every version and point format, and broken files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/unit/scene/points/las_builder.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using testing::HasSubstr;

Corners point(double x, double y, double z) { return {{{x, y, z}, {x, y, z}, {x, y, z}}}; }

TEST(Las, EveryVersionAndPointFormat) {
  for (uint8_t minor = 1; minor <= 4; ++minor)
    for (uint8_t format = 0; format <= 10; ++format)
      for (const uint16_t extra : {0, 5}) {
        LasBuilder las;
        las.minor = minor;
        las.format = format;
        las.extra_bytes = extra;
        las.between = "a variable length record";
        las.behind = "an extended one";
        las.offset = {100, -5, 0.125};
        las.points = {{{1, 2, 3}}, {{-2147483647 - 1, 2147483647, 0}}, {{7, 8, 9}}};
        std::vector<Corners> expected;
        for (const LasPoint& p : las.points)
          expected.push_back(
              point(p.xyz[0] * 0.01 + 100, p.xyz[1] * 0.01 - 5, p.xyz[2] * 0.01 + 0.125));
        EXPECT_EQ(triangles_of_file(las.file()), expected) << +minor << " " << +format;
      }
}

// LAS 1.4 has a 64-bit count of points, but some programs set only the old 32-bit count.
TEST(Las, EitherCountSuffices) {
  for (const bool has_old : {true, false}) {
    LasBuilder las;
    las.minor = 4;
    las.format = 6;
    las.has_old_count = has_old;
    las.has_new_count = !has_old;
    las.points.resize(3);
    EXPECT_EQ(triangles_of_file(las.file()).size(), 3u);
  }
}

// Returns the linear light, from 0 to 65535, of an sRGB value from 0 to 1.
uint16_t light_of(double v) {
  const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(linear * 65535));
}

// Full intensity of a color is 65535, or 255 if no color of the file exceeds 255.
TEST(Las, ColorsOfSixteenAndOfEightBits) {
  using Color = std::array<uint16_t, 4>;
  for (const uint8_t format : {2, 3, 5, 7, 8, 10}) {
    LasBuilder las;
    las.format = format;
    las.points = {{{0, 0, 0}, {255, 10, 0}}, {{1, 0, 0}, {1, 2, 200}}};
    const auto eight = surfaces_of(*OpenScene(las.file()).source);
    ASSERT_EQ(eight.size(), 2u);
    EXPECT_EQ(eight[0].corners[2].color, (Color{65535, light_of(10 / 255.0), 0, 65535}));
    las.points[1].rgb = {1, 2, 40000};
    const auto sixteen = surfaces_of(*OpenScene(las.file()).source);
    EXPECT_EQ(sixteen[0].corners[0].color,
              (Color{light_of(255 / 65535.0), light_of(10 / 65535.0), 0, 65535}));
    EXPECT_EQ(sixteen[1].corners[1].color[2], light_of(40000 / 65535.0));
  }
  LasBuilder white;
  white.points.resize(1);
  EXPECT_EQ(surfaces_of(*OpenScene(white.file()).source).at(0).corners[0].color,
            (Color{65535, 65535, 65535, 65535}));
}

// The scene leaves out withheld points, and a warning counts them. Any range of the other points
// can be read.
TEST(Las, WithheldPointsAreLeftOut) {
  for (const uint8_t format : {0, 6}) {
    LasBuilder las;
    las.format = format;
    las.scale = {1, 1, 1};
    std::vector<Corners> expected;
    for (int i = 0; i < 9000; ++i) {
      const bool is_withheld = i < 1500 || i % 7 == 0 || (i > 4000 && i < 7000);
      las.points.push_back({{i, 2 * i, -i}, {}, is_withheld});
      if (!is_withheld) expected.push_back(point(i, 2 * i, -i));
    }
    OpenScene open(las.file());
    EXPECT_EQ(open.source->declared_triangles(), expected.size());
    EXPECT_EQ(open.triangles(), expected);
    ASSERT_EQ(open.source->warnings().size(), 1u);
    EXPECT_EQ(open.source->warnings()[0].code, "withheld-points");
    EXPECT_EQ(open.source->warnings()[0].count, 9000 - expected.size());
    const auto cursor = open.source->open(1);
    for (const uint64_t first : {3000u, 5u, 2000u, 2047u}) {
      uint64_t at = first;
      cursor->read(first, 2, [&](std::span<const WorldTriangle> batch) {
        for (const WorldTriangle& t : batch) EXPECT_EQ(t.v[2][0], expected[at++][0][0]);
      });
      EXPECT_EQ(at, first + 2);
    }
  }
}

TEST(Las, CompressedFilesAreRefusedByName) {
  for (const int bits : {0x80, 0x40, 0xC0}) {
    LasBuilder las;
    las.points.resize(2);
    std::string file = las.file();
    file[104] = static_cast<char>(bits | 3);
    const Error error = error_of_file(file);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_THAT(error.message(), HasSubstr("LAZ"));
    EXPECT_THAT(error.message(), HasSubstr("laspy"));
  }
}

TEST(Las, TruncatedFilesAreRefused) {
  for (const uint8_t minor : {2, 3, 4}) {
    LasBuilder las;
    las.minor = minor;
    las.between = "between";
    las.points.resize(2);
    const std::string file = las.file();
    for (size_t size = 4; size < file.size(); ++size) {
      const Error error = error_of_file(file.substr(0, size));
      EXPECT_EQ(error.code(), ErrorCode::kInvalidInput) << size;
      EXPECT_NE(error.message(), "") << size;
    }
  }
}

// Changes one number of a valid header, and returns the error message.
template <class T>
std::string message_with(size_t offset, T value, uint8_t minor = 4) {
  LasBuilder las;
  las.minor = minor;
  las.points.resize(2);
  std::string file = las.file();
  LasBuilder::put(file, offset, value);
  return error_of_file(file).message();
}

TEST(Las, BrokenHeadersAreNamed) {
  EXPECT_THAT(message_with<uint8_t>(24, 2), HasSubstr("version 2.4, expected 1.1 to 1.4"));
  EXPECT_THAT(message_with<uint8_t>(25, 5), HasSubstr("version 1.5"));
  EXPECT_THAT(message_with<uint8_t>(25, 0), HasSubstr("version 1.0"));
  EXPECT_THAT(message_with<uint16_t>(94, 300), HasSubstr("300 bytes, expected 375"));
  EXPECT_THAT(message_with<uint32_t>(96, 374), HasSubstr("offset 374"));
  EXPECT_THAT(message_with<uint32_t>(96, UINT32_MAX), HasSubstr("offset 4294967295"));
  EXPECT_THAT(message_with<uint8_t>(104, 11), HasSubstr("point format 11, expected 0 to 10"));
  EXPECT_THAT(message_with<uint16_t>(105, 19), HasSubstr("19 bytes, expected 20 or more"));
  EXPECT_THAT(message_with<uint16_t>(105, 0), HasSubstr("0 bytes"));
  EXPECT_THAT(message_with<uint64_t>(247, UINT64_MAX),
              HasSubstr("18446744073709551615 LAS points"));
  EXPECT_THAT(message_with<uint32_t>(107, UINT32_MAX, 2), HasSubstr("4294967295 LAS points"));
  EXPECT_THAT(message_with<double>(139, 0), HasSubstr("scale factor 0 of Y"));
  EXPECT_THAT(message_with<double>(147, std::nan("")), HasSubstr("scale factor nan of Z"));
  EXPECT_THAT(message_with<double>(155, HUGE_VAL), HasSubstr("offset inf of X"));
}

// A point is invalid if the scale makes a coordinate infinite. The error contains the number of the
// point.
TEST(Las, PointsThatAreNotFiniteAreNamedOrSkipped) {
  LasBuilder las;
  las.scale[1] = std::numeric_limits<double>::max();
  las.points = {{{1, 1, 1}}, {{1, 2, 1}}, {{1, 0, 1}}};
  EXPECT_THAT(error_of_file(las.file()).message(), HasSubstr("point 1 is not a finite position"));
  EXPECT_EQ(OpenScene(las.file(), {.skip_invalid = true}).triangles().size(), 2u);
}

}  // namespace
}  // namespace voxdag::test
