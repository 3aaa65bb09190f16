// PLY files as programs write them: strips, polygons, lists, tolerant headers and texts.
#include <gtest/gtest.h>

#include "tests/unit/scene/ply_writer.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

const std::string kXyzLines = "property float x\nproperty float y\nproperty float z\n";
const std::string kListLine = "property list uchar int vertex_indices\n";
const std::string kRows = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
const std::vector<Corners> kOnlyLower = {{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}};

std::string ascii_header(const std::string& faces) {
  return "ply\nformat ascii 1.0\nelement vertex 3\n" + kXyzLines + "element face 1\n" + faces +
         "end_header\n";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != text.npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

// Returns each triangle as the numbers of its vertices. Vertex i of the file is at (i, 0, 0).
std::vector<std::array<int, 3>> numbers_of(const std::string& file) {
  std::vector<std::array<int, 3>> all;
  for (const Corners& corners : triangles_of_file(file))
    all.push_back({static_cast<int>(corners[0][0]), static_cast<int>(corners[1][0]),
                   static_cast<int>(corners[2][0])});
  return all;
}

template <class Count, class Index>
std::string strips(PlyFormat format, const std::string& types,
                   const std::vector<std::vector<int>>& rows, int vertices = 6) {
  PlyWriter ply(format);
  ply.header("element vertex " + std::to_string(vertices)).header("property float x");
  ply.header("property uchar y").header("property uchar z");
  ply.header("element face 1").header("property list uchar int vertex_indices");
  ply.header("element TriStrips " + std::to_string(rows.size())).header("property ushort before");
  ply.header("property list " + types + " vertex_index").header("property list uchar uchar after");
  ply.header("end_header");
  for (int i = 0; i < vertices; ++i)
    ply.put(static_cast<float>(i)).put_all<uint8_t>({0, 0}).end_row();
  ply.put<uint8_t>(3).put_all<int32_t>({0, 1, 2}).end_row();
  for (const auto& row : rows) {
    ply.put<uint16_t>(1).put(static_cast<Count>(row.size()));
    for (const int index : row) ply.put(static_cast<Index>(index));
    ply.put<uint8_t>(2).put_all<uint8_t>({3, 4}).end_row();
  }
  return ply.text();
}

TEST(PlyVariants, StripsAfterFaces) {
  using Triangles = std::vector<std::array<int, 3>>;
  const Triangles expected = {{0, 1, 2}, {0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {5, 4, 3}, {3, 4, 2}};
  for (const PlyFormat format : kFormats) {
    EXPECT_EQ((numbers_of(strips<int32_t, int32_t>(
                  format, "int int", {{0, 1, 2, 3, 4, -1, 5, 4, 3}, {}, {1, 2}, {3, 4, 2}}))),
              expected);
    EXPECT_EQ((numbers_of(strips<uint8_t, uint8_t>(
                  format, "uchar uchar", {{0, 1, 2, 3, 4, 255, 5, 4, 3, 255, 255}, {3, 4, 2}}))),
              expected);
    EXPECT_EQ((numbers_of(strips<uint16_t, uint32_t>(format, "ushort uint",
                                                     {{0, 1, 2, 3, 4, -1, 5, 4, 3}, {3, 4, 2}}))),
              expected);
    EXPECT_EQ((numbers_of(strips<int64_t, int64_t>(format, "int64 int64",
                                                   {{0, 1, 2, 3, 4, -1, 5, 4, 3}, {3, 4, 2}}))),
              expected);
  }
}

// Triangles with two equal corners only join parts of a strip, so the reader leaves them out.
TEST(PlyVariants, JoinsOfStripsAreLeftOut) {
  EXPECT_EQ((numbers_of(
                strips<int32_t, int32_t>(PlyFormat::kBig, "int int", {{0, 1, 2, 2, 3, 3, 4, 5}}))),
            (std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 1, 2}, {4, 3, 5}}));
  EXPECT_EQ((numbers_of(strips<int32_t, int32_t>(PlyFormat::kAscii, "int int", {{0, 1}}))),
            (std::vector<std::array<int, 3>>{{0, 1, 2}}));
}

// The only strip has more entries than the largest number of corners that a face can have. Reading
// can begin at any triangle.
TEST(PlyVariants, LongStrips) {
  constexpr int kCount = 100000;
  std::vector<int> row;
  for (int i = 0; i < kCount; ++i) row.push_back(i);
  for (const PlyFormat format : kFormats) {
    OpenScene open(strips<int32_t, int32_t>(format, "int int", {row}, kCount));
    EXPECT_EQ(open.source->declared_triangles(), uint64_t{kCount - 1});
    const auto cursor = open.source->open(1);
    for (const int first : {0, 99998, 1, 50000, 50001, 1024, 1025, 70001})
      cursor->read(static_cast<uint64_t>(first), 1, [&](auto batch) {
        const int i = first == 0 ? 0 : first - 1;
        EXPECT_EQ(batch[0].v[0][0] + batch[0].v[1][0] + batch[0].v[2][0], 3 * i + 3);
      });
  }
}

TEST(PlyVariants, IndicesOfStripsOutOfRange) {
  const std::string file =
      strips<int32_t, int32_t>(PlyFormat::kLittle, "int int", {{0, 1, 2}, {3, 4, 6}});
  EXPECT_NE(error_of_file(file).message().find(
                "tristrips 1: index 6 does not exist, there are 6 vertices"),
            std::string::npos);
  EXPECT_NE(error_of_file(strips<int32_t, int32_t>(PlyFormat::kAscii, "int int", {{0, 1, -2}}))
                .message()
                .find("tristrips 0: a vertex with a negative"),
            std::string::npos);
}

TEST(PlyVariants, ConcavePolygons) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement face 3\n" + kListLine + "element vertex 5\n" + kXyzLines +
      "end_header\n4 0 1 2 3\n4 3 0 1 2\n3 0 1 4\n0 0 0\n2 1 5\n0 2 0\n1 1 2.5\n9 9 9\n";
  OpenScene open(file);
  const std::array<double, 3> a{0, 0, 0}, b{2, 1, 5}, c{0, 2, 0}, d{1, 1, 2.5}, e{9, 9, 9};
  std::vector<Corners> all = open.triangles();
  ASSERT_EQ(all.size(), 5u);
  for (Corners& corners : all) std::ranges::sort(corners);
  const auto sorted = [](Corners corners) {
    std::ranges::sort(corners);
    return corners;
  };
  std::ranges::sort(all.begin(), all.begin() + 2);
  std::vector<Corners> halves = {sorted({a, b, d}), sorted({b, c, d})};
  std::ranges::sort(halves);
  EXPECT_EQ(std::vector(all.begin(), all.begin() + 2), halves);
  EXPECT_EQ(all[4], sorted({a, b, e}));
  EXPECT_TRUE(open.source->warnings().empty());
}

TEST(PlyVariants, CrossedPolygonsAreCounted) {
  OpenScene open("ply\nformat ascii 1.0\nelement vertex 4\n" + kXyzLines + "element face 2\n" +
                 kListLine + "end_header\n0 0 0\n1 1 0\n1 0 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n");
  EXPECT_EQ(open.triangles().size(), 3u);
  ASSERT_EQ(open.source->warnings().size(), 1u);
  EXPECT_NE(open.source->warnings()[0].text().find("face 1: its edges cross"), std::string::npos);
}

TEST(PlyVariants, ListsOfVertices) {
  for (const PlyFormat format : kFormats) {
    PlyWriter ply(format);
    ply.header("element vertex 3000").header("property list uchar ushort views");
    ply.header("property float x").header("property list uchar double more");
    ply.header("property float y").header("property float z");
    ply.header("element face 1000").header("property list uchar int vertex_indices");
    ply.header("end_header");
    for (int i = 0; i < 3000; ++i) {
      ply.put(static_cast<uint8_t>(i % 5));
      for (int k = 0; k < i % 5; ++k) ply.put<uint16_t>(7);
      ply.put(static_cast<float>(i)).put(static_cast<uint8_t>(i % 2));
      if (i % 2 == 1) ply.put(0.5);
      ply.put(static_cast<float>(2 * i)).put(static_cast<float>(3 * i)).end_row();
    }
    for (int i = 0; i < 1000; ++i)
      ply.put<uint8_t>(3).put_all<int32_t>({i, 2999 - i, i + 1000}).end_row();
    const std::vector<Corners> all = triangles_of_file(ply.text());
    ASSERT_EQ(all.size(), 1000u);
    for (size_t i = 0; i < 1000; ++i) {
      const double b = 2999 - static_cast<double>(i);
      ASSERT_EQ(all[i][1], (std::array<double, 3>{b, 2 * b, 3 * b}));
    }
  }
}

// A header can have comments, blank lines, unknown lines, and keywords in upper or lower case.
TEST(PlyVariants, TolerantHeaders) {
  const std::string plain = ascii_header(kListLine) + kRows;
  const std::string formats = "format ascii 1.0";
  for (const std::string& file : {
           replaced(plain, formats, "comment first\nobj_info a b\n" + formats),
           replaced(plain, formats, "\n\t\n" + formats),
           replaced(plain, "ply\n", "ply \t\n"),
           "\n" + plain,
           " \r\n\n" + plain,
           "\xef\xbb\xbf" + plain,
           replaced(plain, "ply\n", "PLY\n"),
           replaced(replaced(plain, "float", "FLOAT"), "uchar int", "UInt8 Int32"),
           replaced(plain, "property float", "\tProperty\tfloat32 "),
           replaced(replaced(plain, " x\n", " X\n"), "vertex_indices", "Vertex_Index"),
           replaced(plain, "uchar int", "uint64 int64"),
           replaced(plain, "end_header", "end_header \t"),
           replaced(plain, "element face", "comment element face 7\nelement Face"),
           replaced(plain, "element face",
                    "obj_info x\nelement edge 0\nproperty int a\nelement face"),
           replaced(plain, formats, "element empty 0\n" + formats),
       })
    EXPECT_EQ(triangles_of_file(file), kOnlyLower) << file;
  OpenScene unknown(replaced(plain, "element vertex", "Made by hand\nand more\nelement vertex"));
  EXPECT_EQ(unknown.triangles(), kOnlyLower);
  ASSERT_EQ(unknown.source->warnings().size(), 1u);
  EXPECT_NE(unknown.source->warnings()[0].text().find("line 3 of the header: begins with Made"),
            std::string::npos);
  EXPECT_NE(error_of_file(replaced(plain, "uchar int", "float int")).message().find("float type"),
            std::string::npos);
}

// Lines of one header end in different ways. Binary data may begin with a byte that is a line end.
TEST(PlyVariants, MixedLineEnds) {
  const std::string text = ascii_header(kListLine) + kRows;
  for (const char* line :
       {"ply", "format ascii 1.0", "element face 1", "end_header", "0 0 0", "3 0 1 2"})
    for (const char* line_end : {"\r\n", "\r"})
      EXPECT_EQ(
          triangles_of_file(replaced(text, std::string(line) + "\n", line + std::string(line_end))),
          kOnlyLower)
          << line;
  std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
      "property char x\nproperty char y\nproperty char z\nelement face 1\n" +
      kListLine + "end_header";
  const std::string data("\n\r\n\r\r\n\n\n\r\3\0\0\0\0\1\0\0\0\2\0\0\0", 22);
  const std::vector<Corners> expected = {{{{10, 13, 10}, {13, 13, 10}, {10, 10, 13}}}};
  EXPECT_EQ(triangles_of_file(header + "\n" + data), expected);
  EXPECT_EQ(triangles_of_file(header + "\r\n" + data), expected);
  EXPECT_EQ(triangles_of_file(replaced(header, "ply\n", "ply\r\n") + "\n" + data), expected);
  EXPECT_EQ(triangles_of_file(replaced(header, "\n", "\r\n") + "\n" + data), expected);
  EXPECT_EQ(triangles_of_file(replaced(header, "\n", "\r") + "\r" + data), expected);
}

// Rows need not be lines.
TEST(PlyVariants, RowsOfSeveralLines) {
  const std::string header = ascii_header(kListLine);
  EXPECT_EQ(triangles_of_file(header + replaced(kRows, " ", "\n")), kOnlyLower);
  EXPECT_EQ(triangles_of_file(header + replaced(kRows, "\n", " ")), kOnlyLower);
  EXPECT_EQ(triangles_of_file(header + replaced(kRows, " ", " \r\n\t")), kOnlyLower);
  for (const auto& [rows, message] :
       {std::pair{"0 0 0 1 0 0 0 1 0 3 0 1", "face 0 has too few values"},
        std::pair{"0 0 0 1 0 0 0 1 0 3 0 1 2 4", "has 4 after its last row"}})
    EXPECT_NE(error_of_file(header + rows).message().find(message), std::string::npos) << rows;
}

// Old editors end a text with Ctrl-Z or with NUL bytes.
TEST(PlyVariants, MarksAtTheEnd) {
  const std::string rows = "0 0 0 1 0 0\n0 1 0\n3 0 1 2";
  for (const std::string& mark : {std::string("\x1a"), std::string("\n\x1a"), std::string("\0", 1),
                                  "\r\n\x1a" + std::string(300, '\0')}) {
    EXPECT_EQ(triangles_of_file(ascii_header(kListLine) + kRows + mark), kOnlyLower);
    EXPECT_EQ(triangles_of_file(ascii_header(kListLine) + rows + mark), kOnlyLower);
  }
  EXPECT_NE(error_of_file(ascii_header(kListLine) + rows + "\n\x1a 7").message(), "");
}

TEST(PlyVariants, NumbersAsTextOfOtherPrograms) {
  const std::string header = replaced(ascii_header(kListLine), "vertex 3", "vertex 6");
  const std::string unused =
      "-1.#IND 1.#QNAN 1.#INF\n-1.#IND00 nan -nan(ind)\n1.#SNAN -1.#INF inf\n";
  EXPECT_EQ(triangles_of_file(header + "0 0 0\n1 0 0\n0 1 0\n" + unused + "3.0 0.0 1e0 +2.\n"),
            kOnlyLower);
  EXPECT_NE(error_of_file(header + "1.#IND 0 0\n1 0 0\n0 1 0\n" + unused + "3 0 1 2\n")
                .message()
                .find("vertex 0 is not a finite position"),
            std::string::npos);
  for (const char* word : {"1.#", "1.#XYZ", "2.#INF", "1.#IND5"})
    EXPECT_NE(error_of_file(header + "1 0 " + word + "\n1 0 0\n0 1 0\n" + unused + "3 0 1 2\n")
                  .message()
                  .find("expected a number"),
              std::string::npos)
        << word;
}

// Vertices are read in blocks of 1024, several at once. A damaged vertex that no triangle uses does
// not matter, unless it is in the block of a used vertex.
TEST(PlyVariants, DamagedVerticesFarFromUsedOnes) {
  const std::string header = replaced(ascii_header(kListLine), "vertex 3", "vertex 9000");
  const auto scene = [&](int damaged) {
    std::string rows = "0 0 0\n1 0 0\n0 1 0\n";
    for (int i = 3; i < 9000; ++i) rows += i == damaged ? "0 0 bad\n" : "0 0 0\n";
    return header + rows + "3 0 1 2\n";
  };
  EXPECT_EQ(triangles_of_file(scene(5000)), kOnlyLower);
  EXPECT_NE(error_of_file(scene(1000)).message().find("vertex 1000 has bad"), std::string::npos);
}

}  // namespace
}  // namespace voxdag::test
