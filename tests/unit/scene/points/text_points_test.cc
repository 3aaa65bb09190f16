// Text files with points: columns, separators, line ends, and the errors of bad rows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using testing::HasSubstr;
using Points = std::vector<std::array<double, 3>>;

const Points kTwo = {{0.1, -2, 3e4}, {4, 5.5, 6}};

Points points_of(const std::string& file, SceneOptions options = {}) {
  Points all;
  for (const Corners& triangle : OpenScene(file, std::move(options)).triangles()) {
    EXPECT_EQ(triangle[0], triangle[1]);
    EXPECT_EQ(triangle[0], triangle[2]);
    all.push_back(triangle[0]);
  }
  return all;
}

std::string message_of(const std::string& file, SceneOptions options = {}) {
  try {
    OpenScene(file, std::move(options)).triangles();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInvalidInput);
    return e.message();
  }
  return "no error";
}

TEST(TextPoints, EverySeparatorAndLineEnd) {
  for (const char* separator : {" ", "\t", " \t ", ",", ", ", ";", " ; "})
    for (const char* end : {"\n", "\r\n", "\r"}) {
      const std::string s = separator, e = end;
      EXPECT_EQ(points_of("0.1" + s + "-2" + s + "+3e4" + e + "4" + s + "5.5" + s + "6"), kTwo);
      EXPECT_EQ(points_of("0.1" + s + "-2" + s + "3e4" + e + e + "4" + s + "5.5" + s + "6" + e),
                kTwo);
    }
}

TEST(TextPoints, CommentsBlankLinesAndByteOrderMark) {
  EXPECT_EQ(points_of("\xEF\xBB\xBF# x y z\n//X Y Z\n\n  0.1 -2 30000  \n \t \n #1 2 3\n4 5.5 6\n"),
            kTwo);
  EXPECT_EQ(points_of("1 2 3\n# the end").size(), 1u);
}

TEST(TextPoints, MarksAtTheEnd) {
  for (const std::string& mark : {std::string("\x1a"), std::string("\n\x1a\0\0", 4)})
    EXPECT_EQ(points_of("0.1 -2 30000\n4 5.5 6" + mark), kTwo);
}

TEST(TextPoints, HeaderLineNamesColumns) {
  EXPECT_EQ(points_of("id,Z,\"X\",y,note\n1,30000,0.1,-2,a\n2,6,4,5.5,\"b, c\"\n"), kTwo);
  EXPECT_EQ(points_of("note;x;y;z\n\"a;b\";0.1;-2;3e4\n;4;5.5;6\n"), kTwo);
  // The only row has no line end.
  EXPECT_EQ(points_of("x,y,z\n1,2,3").size(), 1u);
}

TEST(TextPoints, GivenColumns) {
  EXPECT_EQ(points_of("3e4 7 0.1 -2 9\n6 7 4 5.5", {.columns = "z,_,x,Y"}), kTwo);
  // A header line is recognized, but its names are not used.
  EXPECT_EQ(points_of("x,z,y\n0.1,-2,3e4\n4,5.5,6\n", {.columns = "x,y,z"}), kTwo);
  for (const char* columns : {"x,y", "x,y,z,x", "x,y,z,r,g", "x y z", "x,y,z,", "a,b,c", ","})
    EXPECT_THAT(message_of("1 2 3\n", {.columns = columns}), HasSubstr("does not name columns"))
        << columns;
}

// Bad rows are refused with line and reason, or skipped. Rows with decimal commas are bad.
TEST(TextPoints, BadRowsAreNamedOrSkipped) {
  const auto check = [](const std::string& row, const std::string& message) {
    const std::string file = "# comment\r\n1 2 3\r\n\r\n" + row + "\r\n4 5 6\r\n";
    EXPECT_THAT(message_of(file), HasSubstr("folder/scene: line 4: " + message));
    EXPECT_EQ(points_of(file, {.skip_invalid = true}), (Points{{1, 2, 3}, {4, 5, 6}}));
    OpenScene open(file, {.skip_invalid = true});
    EXPECT_EQ(open.source->declared_triangles(), 3u);
  };
  check("7 8", "has 2 columns, expected 3 or more: \"7 8\"");
  check("7 8 z", "has \"z\" in column 3 (z), expected a finite number: \"7 8 z\"");
  check("nan 8 9", "has \"nan\" in column 1 (x)");
  check("7 1e400 9", "has \"1e400\" in column 2 (y)");
  check("7,5 8,5 9,5", "has \"5 8\" in column 2 (y)");
  check("7,5;8,5;9,5", "has \"7,5\" in column 1 (x)");
  check("7,,9", "has \"\" in column 2 (y)");
  check("0x10 1 2", "has \"0x10\"");
}

TEST(TextPoints, LongLinesAreRefused) {
  EXPECT_THAT(error_of_file("1 2 3\n" + std::string(2 << 20, '1') + " 2 3\n").message(),
              HasSubstr("line 2 has over 1048576 bytes"));
  EXPECT_EQ(points_of("1 2 3\n4 5 6 " + std::string(1000000, '1')).size(), 2u);
}

// Returns the linear light, from 0 to 65535, of an sRGB value from 0 to 1.
uint16_t light_in_text(double v) {
  const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(linear * 65535));
}

std::array<uint16_t, 4> color_of(const std::string& file, SceneOptions options = {}) {
  return surfaces_of(*OpenScene(file, std::move(options)).source).at(0).corners[1].color;
}

TEST(TextPoints, Colors) {
  using Color = std::array<uint16_t, 4>;
  const Color white{65535, 65535, 65535, 65535};
  EXPECT_EQ(color_of("1 2 3 255 0 10\n"), (Color{65535, 0, light_in_text(10 / 255.0), 65535}));
  EXPECT_EQ(color_of("1 2 3 1.0 0 0.5\n"), (Color{65535, 0, light_in_text(0.5), 65535}));
  // Without a decimal point in any color, values are from 0 to 255, so 1 means 1/255 of full
  // intensity.
  EXPECT_EQ(color_of("1 2 3 1 0 0\n"), (Color{light_in_text(1 / 255.0), 0, 0, 65535}));
  EXPECT_EQ(color_of("1 2 3 0.5 0 0\n1 2 3 2 0 0\n")[0], light_in_text(0.5 / 255));
  // Without column names, only the last three of exactly six columns can be colors, and only if
  // their values are in a range of colors. Normals and other numbers are not.
  EXPECT_EQ(color_of("1 2 3 0 0 1\n1 2 3 0 -1 0\n"), white);
  EXPECT_EQ(color_of("1 2 3 0 0 300\n"), white);
  EXPECT_EQ(color_of("1 2 3 0 0 0 0\n"), white);
  // Columns with the names of colors, in upper or lower case, are colors; values out of range are
  // clamped.
  EXPECT_EQ(color_of("red,GREEN,b,x,y,z\n300,-5,0,1,2,3\n"), (Color{65535, 0, 0, 65535}));
  EXPECT_EQ(color_of("1 2 3 9 0 255 0\n", {.columns = "x,y,z,_,r,g,b"}),
            (Color{0, 65535, 0, 65535}));
  EXPECT_THAT(message_of("1 2 3 0 0 0\n4 5 6 1 2 red\n"), HasSubstr("\"red\" in column 6 (b)"));
}

// Any range of rows can be read, in a file with many blocks of rows that is read through several
// windows (file_window.h).
TEST(TextPoints, ManyRowsFromAnyRowOn) {
  std::string file = "x,y,z\n";
  for (int i = 0; i < 40000; ++i) {
    file += std::to_string(i) + "," + std::to_string(i % 101) + ".25," + std::string(i % 9, '0') +
            "7\n";
    if (i % 1000 == 999) file += "# comment\n";
  }
  OpenScene open(file, {}, 2 << 20);
  ASSERT_EQ(open.source->declared_triangles(), 40000u);
  const auto all = open.triangles();
  for (size_t i = 0; i < all.size(); ++i)
    ASSERT_EQ(all[i][0], (std::array<double, 3>{double(i), double(i % 101) + 0.25, 7}));
  const auto cursor = open.source->open(3);
  for (const uint64_t first : {39998u, 0u, 1023u, 1024u, 30000u, 30001u, 29000u}) {
    uint64_t at = first;
    cursor->read(first, 2, [&](std::span<const WorldTriangle> batch) {
      for (const WorldTriangle& t : batch) EXPECT_EQ(t.v[0][0], static_cast<double>(at++));
    });
    EXPECT_EQ(at, first + 2);
  }
}

// The file's name has no extension, so the contents decide whether it has points. Other text files
// are refused.
TEST(TextPoints, OtherTextFilesAreRefused) {
  for (const char* file : {"v 1 2 3\nf 1 2 3\n", "OFF\n8 6 12\n0 0 0\n", "# .PCD v.7\nVERSION .7\n",
                           "1 2\n3 4\n", "version https://git-lfs\n", "x,y,z\na,b,c\n", "", "\n\n"})
    EXPECT_THAT(message_of(file), HasSubstr("folder/scene: ")) << file;
}

// A text file with the extension of point files is read as points even if its first row is bad.
TEST(TextPoints, EndingsMakeTextAFileOfPoints) {
  for (const char* name : {"a.xyz", "a.TXT", "b.csv"}) {
    MemoryFiles files;
    files.contents[name] = "lon lat\n1 2 3\n";
    MemoryBudget budget(uint64_t{64} << 20);
    CancelToken cancel;
    const auto scene = open_scene(files, {name}, {.skip_invalid = true}, budget, cancel);
    EXPECT_EQ(triangles_of(*scene).size(), 1u);
    EXPECT_EQ(scene->declared_triangles(), 2u);
  }
}

}  // namespace
}  // namespace voxdag::test
