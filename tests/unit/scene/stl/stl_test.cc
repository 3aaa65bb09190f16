// Reads binary and ASCII STL files made by the tests.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "scene/textures/linear_light.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Channels = std::array<uint16_t, 4>;

const Corners kLower = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
const std::vector<float> kFacet = {0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0};

std::string facet_bytes(const std::vector<float>& numbers, uint16_t attribute = 0) {
  std::string bytes(reinterpret_cast<const char*>(numbers.data()), 4 * numbers.size());
  return bytes + static_cast<char>(attribute & 255) + static_cast<char>(attribute >> 8);
}

std::string binary_stl(const std::string& facets, uint32_t declared, std::string header = "") {
  header.resize(80, ' ');
  return header + little_endian(declared) + facets;
}

std::string ascii_facet(
    const std::string& vertices = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n") {
  return "facet normal 0 0 1\nouter loop\n" + vertices + "endloop\nendfacet\n";
}

TEST(Stl, BinaryIsToldByItsSize) {
  for (const char* header : {"", "solid", "solid name\nfacet normal 0 0 1\n"})
    EXPECT_EQ(triangles_of_file(binary_stl(facet_bytes(kFacet), 1, header)),
              std::vector<Corners>{kLower});
  EXPECT_TRUE(triangles_of_file(binary_stl("", 0)).empty());
}

TEST(Stl, BinaryWithAnotherSize) {
  const auto warning_of = [](const std::string& file) {
    OpenScene open(file);
    EXPECT_EQ(open.triangles(), std::vector<Corners>{kLower});
    EXPECT_EQ(open.source->warnings().size(), 1u);
    return open.source->warnings()[0].text();
  };
  EXPECT_THAT(warning_of(binary_stl(facet_bytes(kFacet) + "more", 1)),
              HasSubstr("4 bytes after the 1 facets"));
  EXPECT_THAT(warning_of(binary_stl(facet_bytes(kFacet), 0)), HasSubstr("declares 0 facets"));
  EXPECT_THAT(warning_of(binary_stl(facet_bytes(kFacet), 0xffffffff)), HasSubstr("all facets"));
  EXPECT_EQ(error_of_file(binary_stl(facet_bytes(kFacet) + "cut", 7)).message(),
            "folder/scene: its header declares 7 facets, which need 434 bytes, but the file has "
            "137");
}

TEST(Stl, AsciiInManyForms) {
  const std::vector<Corners> one{kLower};
  for (const std::string& file : std::initializer_list<std::string>{
           "solid\n" + ascii_facet() + "endsolid\n",
           "solid facet of vertex\n" + ascii_facet() + "endsolid facet of vertex",
           "SOLID X\n  FACET NORMAL 0 0 1\n OUTER LOOP\n VERTEX 0 0 0\n"
           "\tVertex 1 0 0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\nENDSOLID X",
           std::string(
               "solid a\nfacet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex +0 1e0 "
               "0 endloop endfacet endsolid a"),
           "solid a\n" + ascii_facet("vertex 0\n0 0\nvertex 1 0 0\n\nvertex 0 1 0\n") +
               "endsolid a",
           std::string("solid\nfacet normal nan nan nan\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                       "vertex 0 1 0\nendloop\nendfacet\n")})
    EXPECT_EQ(triangles_of_file(file), one) << file;
  std::string crlf;
  for (const char c : "solid\n" + ascii_facet() + "endsolid")
    crlf += c == '\n' ? "\r\n" : std::string(1, c);
  EXPECT_EQ(triangles_of_file(crlf), one);
  const std::string solid = "solid a\n" + ascii_facet() + "endsolid a\n";
  EXPECT_EQ(triangles_of_file(solid + "\n" + solid), (std::vector<Corners>{kLower, kLower}));
  EXPECT_TRUE(triangles_of_file("solid a\nendsolid a\n").empty());
}

std::string with_line_ends(std::string text) {
  std::ranges::replace(text, ' ', '\n');
  return text;
}

// Line ends only separate words, except that they end the names of solids.
TEST(Stl, AsciiWordsInAnyLines) {
  const std::string facet =
      "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 "
      "endloop endfacet ";
  const std::vector<Corners> one{kLower}, two{kLower, kLower};
  const std::pair<std::string, std::vector<Corners>> cases[] = {
      {"solid a part " + facet + "endsolid a part", one},
      {"solid " + facet + "\nendsolid", one},
      {"solid a " + facet + "endsolid a solid b " + facet + "endsolid b\n", two},
      {"solid a " + facet + "\n" + ascii_facet() + "endsolid", two},
      {with_line_ends("solid a " + facet + facet + "endsolid a "), two},
      {with_line_ends("solid " + facet + "endsolid solid b " + facet + "endsolid"), two},
      {"solid a\nfacet\nnormal 0 0\n1\nouter loop vertex\n0 0 0 vertex 1 0 0\nvertex 0 1 0 endloop "
       "endfacet endsolid",
       one},
      {"solid vertex 1\n" + ascii_facet() + "endsolid vertex 1\n", one}};
  for (const auto& [file, triangles] : cases) {
    OpenScene open(file);
    EXPECT_EQ(open.triangles(), triangles) << file;
    EXPECT_TRUE(open.source->warnings().empty()) << file;
  }
  OpenScene open("solid a\ncolor 1 0 0 " + facet + "material 7 endsolid a\n");
  EXPECT_EQ(open.triangles(), one);
  EXPECT_THAT(texts_of(open.source->warnings()), ElementsAre(HasSubstr("not part of STL")));
}

TEST(Stl, AsciiFacetsOfOtherSizes) {
  const std::string square = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nvertex -1 1 0\n";
  OpenScene open("solid\n" + ascii_facet("vertex 0 0 0\nvertex 1 1 1\n") + ascii_facet(square) +
                 "color 1 0 0\nendsolid");
  EXPECT_EQ(open.triangles(), (std::vector<Corners>{kLower, {{{0, 0, 0}, {0, 1, 0}, {-1, 1, 0}}}}));
  EXPECT_THAT(texts_of(open.source->warnings()),
              ElementsAre(HasSubstr("line 4: a facet of fewer than three vertices"),
                          HasSubstr("words that are not part of STL are ignored")));
}

TEST(Stl, FaultsNameTheLine) {
  const auto message = [](const std::string& file) { return error_of_file(file).message(); };
  EXPECT_THAT(message("solid\n" + ascii_facet("vertex 0 0 zero\n")),
              HasSubstr("line 4 has zero, expected a coordinate"));
  EXPECT_THAT(message("solid\n" + ascii_facet("vertex 0 0\n")),
              HasSubstr("line 5 has endloop, expected a coordinate"));
  EXPECT_THAT(message("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"),
              HasSubstr("within a facet"));
  EXPECT_THAT(message("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0"),
              HasSubstr("without three numbers"));
  EXPECT_THAT(message("solid\n" + ascii_facet() +
                      ascii_facet("vertex 0 0 0\nvertex 1 0 0\nvertex 0 inf 0\n")),
              HasSubstr("facet 1 in line 11: a vertex is not a finite position"));
  std::vector<float> broken = kFacet;
  broken[5] = NAN;
  const std::string facets = facet_bytes(kFacet) + facet_bytes(broken) + facet_bytes(kFacet);
  EXPECT_THAT(message(binary_stl(facets, 3)),
              testing::StartsWith("folder/scene: facet 1: a vertex is not a finite position"));
  OpenScene open(binary_stl(facets, 3), {.skip_invalid = true});
  EXPECT_EQ(open.triangles(), (std::vector<Corners>{kLower, kLower}));
}

TEST(Stl, TrianglesFromAnyNumberOn) {
  std::string text = "solid\n", facets;
  for (int i = 0; i < 3000; ++i) {
    const std::string n = std::to_string(i);
    text += ascii_facet("vertex " + n + " 0 0\nvertex 1 " + n + " 0\nvertex 0 1 0\n");
    const auto f = static_cast<float>(i);
    facets += facet_bytes({0, 0, 1, f, 0, 0, 1, f, 0, 0, 1, 0});
  }
  for (const std::string& file : {text + "endsolid\n", binary_stl(facets, 3000)}) {
    OpenScene open(file);
    ASSERT_EQ(open.source->declared_triangles(), 3000u);
    EXPECT_EQ(open.triangles()[2999][1][1], 2999);
    const auto cursor = open.source->open(2);
    for (const uint64_t first : {2900u, 2950u, 17u, 18u, 2048u, 1023u})
      cursor->read(first, 1,
                   [&](auto batch) { EXPECT_EQ(batch[0].v[0][0], static_cast<double>(first)); });
  }
}

TEST(Stl, ColorsOfFacets) {
  const auto colors_of = [](const std::string& header) {
    const std::string facets =
        facet_bytes(kFacet, 0x8000 | 31 | 15 << 5) + facet_bytes(kFacet, 31 | 15 << 5);
    OpenScene open(binary_stl(facets, 2, header));
    const auto all = surfaces_of(*open.source);
    return std::pair(all.at(0).corners[0].color, all.at(1).corners[2].color);
  };
  const uint16_t middle = linear_light(15 / 31.0);
  EXPECT_EQ(colors_of("VisCAM"),
            (std::pair(Channels{0, middle, 65535, 65535}, Channels{65535, 65535, 65535, 65535})));
  EXPECT_EQ(
      colors_of(std::string("COLOR=\x33\0\xff\xff,MATERIAL=", 20)),
      (std::pair(Channels{linear_light(0.2), 0, 65535, 65535}, Channels{65535, middle, 0, 65535})));
}

TEST(Stl, OtherFilesAreNotClaimed) {
  const auto is_stl = [](const std::string& file) {
    OpenScene open("v 0 0 0\nf 1 1 1\n");
    open.files.contents["x"] = file;
    for (const SceneFormat& format : scene_formats())
      if (format.name == "STL") return format.sniff(*open.files.open_read("x"));
    return false;
  };
  EXPECT_FALSE(is_stl(""));
  EXPECT_FALSE(is_stl(std::string(1000, '\0')));
  EXPECT_FALSE(is_stl("solid rock\nis hard\n"));
  EXPECT_FALSE(is_stl("Kaydara FBX Binary  " + std::string(500, '\x1a')));
  std::string noise;
  for (uint32_t i = 0; i < 5000; ++i) noise += static_cast<char>(i * i * 2654435761u >> 24);
  EXPECT_FALSE(is_stl(noise));
  EXPECT_TRUE(is_stl(binary_stl(facet_bytes(kFacet) + "x", 1)));
}

// Small files are read in one step, and stay in memory as long as the scene. Many of them together
// must not take more memory than one.
TEST(Stl, ManySmallFilesTakeLittleMemory) {
  MemoryFiles files;
  std::vector<std::string> names;
  std::string facets;
  for (int i = 0; i < 4000; ++i) facets += facet_bytes(kFacet);
  for (int i = 0; i < 100; ++i) {
    names.push_back(std::to_string(i) + ".stl");
    files.contents[names.back()] = binary_stl(facets, 4000);
  }
  const CancelToken never;
  for (const uint64_t limit : {uint64_t{64} << 20, uint64_t{8} << 20}) {
    MemoryBudget budget(limit);
    const auto source = open_scene(files, names, {}, budget, never);
    EXPECT_EQ(source->declared_triangles(), 400'000u);
    EXPECT_GT(budget.used(), 0u);
    EXPECT_LE(budget.used(), std::min(uint64_t{1} << 20, limit / 16));
  }
}

}  // namespace
}  // namespace voxdag::test
