// PLY files made by the tests. Every format and layout gives the triangles of the same mesh, and
// the errors of broken files name the problem.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/unit/scene/ply_writer.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

const Corners kLowHalf = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};

// Returns a file with the triangle (0 0 0) (1 0 0) (0 1 0), as most programs write it.
std::string plain_triangle(PlyFormat format, const std::string& line_end = "\n") {
  PlyWriter ply(format, line_end);
  ply.header("comment made here").header("element vertex 3");
  for (const char* axis : {"x", "y", "z"}) ply.header(std::string("property float ") + axis);
  ply.header("element face 1").header("property list uchar int vertex_indices");
  ply.header("end_header");
  ply.put_all<float>({0, 0, 0}).end_row().put_all<float>({1, 0, 0}).end_row();
  ply.put_all<float>({0, 1, 0}).end_row();
  return ply.put<uint8_t>(3).put_all<int32_t>({0, 1, 2}).end_row().text();
}

TEST(Ply, TriangleInEveryFormatAndLineEnding) {
  for (const PlyFormat format : kFormats)
    for (const char* line_end : {"\n", "\r\n", "\r"})
      EXPECT_EQ(triangles_of_file(plain_triangle(format, line_end)),
                std::vector<Corners>{kLowHalf});
}

// Properties can have any order and any type. Other elements can be before and between the vertices
// and the faces, and lists of any width before and after the vertex indices. Doubles keep all their
// digits.
TEST(Ply, OtherElementsAndPropertiesAreSkipped) {
  for (const PlyFormat format : kFormats) {
    PlyWriter ply(format);
    ply.header("element camera 2").header("property double view").header("property uchar kind");
    ply.header("element path 2").header("property list ushort double at");
    ply.header("element vertex 4").header("property uchar red").header("property double z");
    ply.header("property short label").header("property float x").header("property double y");
    ply.header("element edge 1").header("property int32 vertex1");
    ply.header("element face 1").header("property list int8 float texcoord");
    ply.header("property uint8 flags").header("property list uint32 uint16 vertex_index");
    ply.header("property list uint8 uint8 groups").header("property float area");
    ply.header("element behind 1").header("property list int int more").header("end_header");
    for (int i = 0; i < 2; ++i) ply.put(0.5).put<uint8_t>(1).end_row();
    ply.put<uint16_t>(0).end_row().put<uint16_t>(2).put(1.0).put(2.0).end_row();
    const double y[] = {0.1, 0.2, 0.30000000000000004, 9};
    for (int i = 0; i < 4; ++i)
      ply.put<uint8_t>(7).put(i + 1e-9).put<int16_t>(-3).put(0.1f).put(y[i]).end_row();
    ply.put<int32_t>(1).end_row();
    ply.put<int8_t>(2).put(1.5f).put(2.5f).put<uint8_t>(1);
    ply.put<uint32_t>(3).put_all<uint16_t>({2, 0, 1});
    ply.put<uint8_t>(1).put<uint8_t>(5).put(4.0f).end_row();
    const double x = static_cast<double>(0.1f);
    EXPECT_EQ(
        triangles_of_file(ply.text()),
        (std::vector<Corners>{{{{x, y[2], 2 + 1e-9}, {x, y[0], 1e-9}, {x, y[1], 1 + 1e-9}}}}));
  }
}

// Returns a writer with the header of a mesh. Vertices have float coordinates. `list_types` is the
// types of a face's count and of its indices.
PlyWriter mesh_header(PlyFormat format, size_t vertices, size_t faces, const char* list_types) {
  PlyWriter ply(format);
  ply.header("element vertex " + std::to_string(vertices));
  for (const char* axis : {"x", "y", "z"}) ply.header(std::string("property float ") + axis);
  ply.header("element face " + std::to_string(faces));
  ply.header(std::string("property list ") + list_types + " vertex_indices").header("end_header");
  return ply;
}

// Reads thousands of faces with 0 to 9 corners. The corners are on a parabola, so that the faces
// are convex. Each face becomes a fan of triangles, in the order of the file. Reading can begin at
// any triangle.
TEST(Ply, PolygonsAreFansFromAnyTriangleOn) {
  constexpr uint32_t kVertices = 5000, kFaces = 5000;
  for (const PlyFormat format : kFormats) {
    PlyWriter ply = mesh_header(format, kVertices, kFaces, "ushort uint");
    for (uint32_t i = 0; i < kVertices; ++i)
      ply.put(static_cast<float>(i)).put(static_cast<float>(i * i)).put(1.0f).end_row();
    std::vector<Corners> expected;
    const auto corner = [](uint32_t v) {
      return std::array<double, 3>{double(v), double(static_cast<float>(v * v)), 1};
    };
    for (uint32_t f = 0; f < kFaces; ++f) {
      const uint32_t n = f * 7 % 10;
      const auto index = [&](uint32_t k) { return (f * 31 + k * k) % kVertices; };
      ply.put(static_cast<uint16_t>(n));
      for (uint32_t k = 0; k < n; ++k) ply.put(index(k));
      ply.end_row();
      for (uint32_t k = 2; k < n; ++k)
        expected.push_back({corner(index(0)), corner(index(k - 1)), corner(index(k))});
    }
    OpenScene open(ply.text());
    EXPECT_EQ(open.source->declared_triangles(), expected.size());
    EXPECT_EQ(open.triangles(), expected);
    ASSERT_EQ(open.source->warnings().size(), 1u);
    EXPECT_NE(open.source->warnings()[0].text().find("three corners make no voxels (1500 times)"),
              std::string::npos);
    const auto cursor = open.source->open(3);
    for (uint64_t first :
         {uint64_t{9000}, uint64_t{1}, uint64_t{1022}, uint64_t{9001}, uint64_t{5}})
      cursor->read(first, 3, [&](std::span<const WorldTriangle> batch) {
        ASSERT_EQ(batch.size(), 3u);
        for (size_t i = 0; i < 3; ++i)
          for (size_t k = 0; k < 3; ++k)
            EXPECT_EQ(batch[i].v[k][0], expected[first + i][k][0]) << first;
      });
  }
}

// A PLY file and a glTF file with the same mesh have the same snapped triangles.
TEST(Ply, SnapsAsTheSameMeshInGltf) {
  std::vector<float> xyz;
  for (uint32_t i = 0; i < 3000; ++i)
    xyz.insert(xyz.end(), {static_cast<float>(i % 61) * 0.3f, static_cast<float>(i / 61) / 7,
                           static_cast<float>(i * 13 % 101) - 0.1f});
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < 12000; ++i) indices.push_back(i * 17 % 3000);
  SceneBuilder gltf;
  const int positions = gltf.add_positions(xyz);
  const int list = gltf.add_accessor("SCALAR", kU32, indices);
  gltf.add_root(
      {{"mesh", gltf.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", list}})}});
  PlyWriter ply = mesh_header(PlyFormat::kBig, 3000, 4000, "uchar uint");
  for (const float c : xyz) ply.put(c);
  for (size_t i = 0; i < indices.size(); i += 3)
    ply.put<uint8_t>(3).put_all<uint32_t>({indices[i], indices[i + 1], indices[i + 2]});

  const auto snapped = [](std::string file) {
    OpenScene open(std::move(file));
    const auto cursor = open.source->open(1);
    const uint64_t n = open.source->declared_triangles();
    std::vector<double> all;
    const Grid grid = Grid::around(cursor->read_bounds(0, n), 12);
    cursor->read_snapped(0, n, grid, [&](std::span<const RealTriangle> batch) {
      for (const RealTriangle& t : batch) all.insert(all.end(), &t.v[0][0], &t.v[0][0] + 9);
    });
    return all;
  };
  const auto expected = snapped(gltf.glb());
  EXPECT_EQ(expected.size(), 4000u * 9);
  EXPECT_EQ(snapped(ply.text()), expected);
}

// Returns a file with three colored vertices and a face. T is the type of the colors.
template <class T>
std::string colored_triangle(PlyFormat format, const std::string& type, bool has_alpha,
                             const std::vector<T>& colors) {
  PlyWriter ply(format);
  ply.header("element vertex 3").header("property float x").header("property " + type + " blue");
  ply.header("property " + type + " red").header("property " + type + " green");
  if (has_alpha) ply.header("property " + type + " alpha");
  ply.header("property double y").header("property short z").header("element face 1");
  ply.header("property list uchar int vertex_indices").header("end_header");
  for (size_t v = 0; v < 3; ++v) {
    const size_t channels = has_alpha ? 4 : 3;
    const T* const rgba = &colors[channels * v];
    ply.put<float>(v == 1 ? 1 : 0).put(rgba[2]).put(rgba[0]).put(rgba[1]);
    if (has_alpha) ply.put(rgba[3]);
    ply.put<double>(v == 2 ? 1 : 0).put<int16_t>(0).end_row();
  }
  return ply.put<uint8_t>(3).put_all<int32_t>({0, 1, 2}).end_row().text();
}

// Returns the linear light of an sRGB value, from 0 to 65535, rounded to nearest.
uint16_t linear_light(double v) {
  const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(linear * 65535));
}

TEST(Ply, ColorsOfVertices) {
  using Rgba = std::array<uint16_t, 4>;
  const auto colors_of = [](const std::string& file) {
    OpenScene open(file);
    EXPECT_EQ(open.triangles(), std::vector<Corners>{kLowHalf});
    const auto all = surfaces_of(*open.source);
    EXPECT_EQ(all.at(0).position.v[2][1], 1);
    EXPECT_EQ(all.at(0).material, 0u);
    std::array<Rgba, 3> colors;
    for (size_t k = 0; k < 3; ++k) colors[k] = all.at(0).corners[k].color;
    return colors;
  };
  for (const PlyFormat format : kFormats) {
    EXPECT_EQ(colors_of(colored_triangle<uint8_t>(format, "uchar", true,
                                                  {0, 255, 10, 128, 1, 2, 3, 0, 188, 11, 12, 255})),
              (std::array{Rgba{0, 65535, linear_light(10 / 255.0), 128 * 257},
                          Rgba{linear_light(1 / 255.0), linear_light(2 / 255.0),
                               linear_light(3 / 255.0), 0},
                          Rgba{linear_light(188 / 255.0), linear_light(11 / 255.0),
                               linear_light(12 / 255.0), 65535}}));
    EXPECT_EQ(colors_of(colored_triangle<uint16_t>(format, "ushort", false,
                                                   {0, 65535, 300, 1, 2, 3, 40000, 255, 256}))[2],
              (Rgba{linear_light(40000 / 65535.0), linear_light(255 / 65535.0),
                    linear_light(256 / 65535.0), 65535}));
    EXPECT_EQ(colors_of(colored_triangle<float>(format, "float", true,
                                                {0, 1, 0.5, 0.25, -1, 1.5, 0, 2, 1, 1, 1, 1})),
              (std::array{Rgba{0, 65535, linear_light(0.5), 16384}, Rgba{0, 65535, 0, 65535},
                          Rgba{65535, 65535, 65535, 65535}}));
    EXPECT_EQ(colors_of(colored_triangle<int32_t>(format, "int", false,
                                                  {300, -5, 77, 0, 0, 0, 0, 0, 0}))[0],
              (Rgba{65535, 0, linear_light(77 / 255.0), 65535}));
  }
  // If the property `blue` is missing, the file counts as a file without colors, so the color is
  // white.
  std::string file =
      colored_triangle<uint8_t>(PlyFormat::kLittle, "uchar", false, {0, 0, 0, 0, 0, 0, 0, 0, 0});
  file.replace(file.find("blue"), 4, "glue");
  EXPECT_EQ(colors_of(file)[1], (Rgba{65535, 65535, 65535, 65535}));
}

// The colors have all 256 values. The file has more vertices than the cache of vertices can hold,
// so later blocks of vertices replace earlier ones.
TEST(Ply, ColorsOfManyVertices) {
  constexpr uint32_t kVertices = 50000;
  PlyWriter ply(PlyFormat::kLittle);
  ply.header("element vertex " + std::to_string(kVertices));
  for (const char* axis : {"x", "y", "z"}) ply.header(std::string("property uchar ") + axis);
  for (const char* name : {"red", "green", "blue"})
    ply.header(std::string("property uchar ") + name);
  ply.header("element face 400").header("property list uchar int vertex_indices");
  ply.header("end_header");
  for (uint32_t v = 0; v < kVertices; ++v)
    for (const uint32_t number : {v, 2 * v, 3 * v, v, v / 256, v % 251})
      ply.put(static_cast<uint8_t>(number));
  const auto vertex = [](uint32_t face, uint32_t k) {
    return (face * 77771 + k * 31337) % kVertices;
  };
  for (uint32_t f = 0; f < 400; ++f) {
    ply.put<uint8_t>(3);
    for (uint32_t k = 0; k < 3; ++k) ply.put(static_cast<int32_t>(vertex(f, k)));
  }
  OpenScene open(ply.text(), {}, 2 << 20);
  const auto all = surfaces_of(*open.source);
  ASSERT_EQ(all.size(), 400u);
  for (uint32_t f = 0; f < 400; ++f)
    for (uint32_t k = 0; k < 3; ++k) {
      const uint32_t v = vertex(f, k);
      ASSERT_EQ(
          all[f].corners[k].color,
          (std::array<uint16_t, 4>{linear_light(v % 256 / 255.0), linear_light(v / 256 / 255.0),
                                   linear_light(v % 251 / 255.0), 65535}));
    }
}

// A scene of several glTF and PLY files has the triangles of all files, in the given order of the
// files.
TEST(Ply, FilesOfBothFormatsAreOneScene) {
  MemoryFiles files;
  files.contents["a"] = plain_triangle(PlyFormat::kLittle);
  files.contents["b"] = one_triangle().glb();
  files.contents["c"] = plain_triangle(PlyFormat::kAscii);
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  const auto scene = open_scene(files, {"a", "b", "b", "c"}, {}, budget, cancel);
  EXPECT_EQ(triangles_of(*scene), (std::vector<Corners>{kLowHalf, kLowHalf, kLowHalf, kLowHalf}));
  ASSERT_EQ(scene->files().size(), 4u);
  EXPECT_EQ(scene->files()[3].path, "c");
}

// A file that is truncated anywhere is refused. The exception is an ASCII file in which only the
// last line end is missing.
TEST(Ply, TruncatedFilesAreRefused) {
  for (const PlyFormat format : kFormats) {
    const std::string whole = plain_triangle(format);
    const size_t least = whole.size() - (format == PlyFormat::kAscii ? 1 : 0);
    for (size_t size = 0; size < least; ++size) {
      const Error error = error_of_file(whole.substr(0, size));
      EXPECT_EQ(error.code(), ErrorCode::kInvalidInput) << size;
      EXPECT_NE(error.message(), "") << size;
    }
  }
}

TEST(Ply, InvalidTrianglesAreNamedOrSkipped) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const PlyFormat format : kFormats) {
    PlyWriter ply = mesh_header(format, 4, 4, "uchar int");
    for (const float x : {0.0f, 1.0f, 0.0f, nan})
      ply.put(x).put(ply.text().size() % 2 ? 1.0f : 0.0f).put(0.0f).end_row();
    ply.put<uint8_t>(3).put_all<int32_t>({0, 1, 2}).end_row();
    ply.put<uint8_t>(4).put_all<int32_t>({0, 1, 2, 3}).end_row();
    ply.put<uint8_t>(3).put_all<int32_t>({0, 1, 4}).end_row();
    ply.put<uint8_t>(3).put_all<int32_t>({0, -1, 1}).end_row();
    const std::string message = error_of_file(ply.text()).message();
    EXPECT_NE(message.find("folder/scene: face 1: vertex 3 is not a finite position"),
              std::string::npos)
        << message;
    OpenScene skipping(ply.text(), {.skip_invalid = true});
    EXPECT_EQ(skipping.source->declared_triangles(), 5u);
    EXPECT_EQ(skipping.triangles().size(), 2u);
  }
  for (const auto& [index, text] :
       {std::pair{7, "face 0: index 7 does not exist, there are 3 vertices"},
        std::pair{-2, "face 0: a vertex with a negative"}}) {
    PlyWriter ply = mesh_header(PlyFormat::kLittle, 3, 1, "uchar int");
    for (int i = 0; i < 9; ++i) ply.put(0.0f);
    ply.put<uint8_t>(3).put_all<int32_t>({0, 1, index});
    EXPECT_NE(error_of_file(ply.text()).message().find(text), std::string::npos);
  }
}

// Headers that are invalid, or that declare more rows than the file has, are refused.
TEST(Ply, HostileHeadersAreRefused) {
  const std::string begin = "ply\nformat binary_little_endian 1.0\n";
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string list = "property list uchar int vertex_indices\n";
  const std::pair<std::string, const char*> cases[] = {
      {begin + "element vertex 2147483648\n" + xyz + "end_header\n", "end past the"},
      {begin + "element vertex 18446744073709551615\n" + xyz + "end_header\n", "limit is 2^32"},
      {begin + "element vertex 18446744073709551616\n" + xyz + "end_header\n", "below 2^64"},
      {begin + "element vertex -1\n" + xyz + "end_header\n", "below 2^64"},
      {begin + "element vertex 0\n" + xyz + "element face 18446744073709551615\n" + list +
           "end_header\n",
       "face 0 is cut off"},
      {begin + "element a 18446744073709551615\nelement b 3\nproperty int c\nelement vertex 0\n" +
           xyz + "end_header\n",
       "element b"},
      {begin + "element vertex 0\nproperty float x\nend_header\n", "without a property y"},
      {begin + "element vertex 0\n" + xyz + "element face 1\nproperty int k\nend_header\n",
       "vertex_indices"},
      {begin + "element vertex 0\n" + xyz +
           "element face 1\nproperty list uchar float vertex_indices\nend_header\n",
       "is not a list of integers"},
      {begin + "element vertex 0\nproperty list float int x\nend_header\n",
       "float type for the count of a list"},
      {begin + "element vertex 0\nproperty list uchar int x\nend_header\n", "without a property x"},
      {begin + "element vertex 0\n" + xyz + "element tristrips 1\n" + list + "end_header\n",
       "tristrips 0 is cut off"},
      {begin + "element vertex 0\n" + xyz + "element tristrips 1\nproperty int a\nend_header\n",
       "tristrips without vertices, expected a list vertex_indices"},
      {begin + "element vertex 0\n" + xyz + "element tristrips 1\n" + list + "end_header\n\3\1",
       "tristrips 0 is cut off"},
      {begin + "element vertex 0\n" + xyz +
           "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" +
           std::string("\xff\xff\xff\x7f", 4),
       "tristrips 0 has a list of 2147483647 entries"},
      {begin + "format ascii 1.0\nend_header\n", "second format line"},
      {begin + "element vertex 0\npropertie float x\nend_header\n", "begins with propertie"},
      {begin + "element vertex 0\n" + xyz + "element vertex 0\nend_header\n",
       "repeats the name of an element"},
      {begin + "property float x\nend_header\n",
       "line 3 of the header declares a property before any element"},
      {begin + "element vertex 0\nproperty int24 x\nend_header\n", "int24"},
      {begin + "elements 0\nend_header\n", "begins with elements"},
      {begin + "end_header\n", "no element vertex"},
      {"ply\nformat binary 1.0\nend_header\n", "the format binary"},
      {"ply\nformat ascii 2.0\nend_header\n", "expected 1.0"},
      {"ply\ncomment\nend_header\n", "format NAME"},
      {begin + std::string(70000, '\n'), "over 65536 bytes"},
      {begin + "element vertex 0\n" + xyz +
           "element face 1\nproperty list int int vertex_indices\nend_header\n" +
           std::string("\xff\xff\xff\xff", 4),
       "face 0 has a list of -1 entries"},
      {begin + "element vertex 0\n" + xyz +
           "element face 1\nproperty list uint int vertex_indices\nend_header\n" +
           std::string("\xff\xff\xff\x7f", 4),
       "the limit is 32768"},
  };
  for (const auto& [file, message] : cases) {
    const Error error = error_of_file(file);
    EXPECT_NE(error.message().find(message), std::string::npos) << file << "\n" << error.message();
  }
}

TEST(Ply, HostileTextIsRefused) {
  const std::string begin =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::pair<std::string, const char*> cases[] = {
      {"0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n", "vertex 1 has zero, expected a number"},
      {"0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "vertex 1 has too few values on its line"},
      {"0 0 0\n1 0 0 0\n0 1 0\n3 0 1 2\n", "vertex 1 has more on its line"},
      {"0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "face 0 has too few values"},
      {"0 0 0\n1 0 0\n0 1 0\n3 0 1 2.5\n", "face 0 has 2.5, expected an integer"},
      {"0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", "a list of -3 entries"},
      {"0 0 0\n1 0 0\n0 1 0\n99999999999999999999 0 1 2\n", "expected an integer"},
      {"0 0 0\n1 0 0\n0 1 1" + std::string(100, '0') + "\n3 0 1 2\n", "vertex 2 ha"},
      {"0 0 0\n1 0 0\n0 1 inf\n3 0 1 2\n", "vertex 2 is not a finite position"},
      {"0 0 0\n1 0 0\n0 1 1e99\n3 0 1 2\n", "vertex 2 is not a finite position"},
  };
  for (const auto& [rows, message] : cases) {
    const Error error = error_of_file(begin + rows);
    EXPECT_NE(error.message().find(message), std::string::npos) << rows << "\n" << error.message();
  }
  EXPECT_EQ(triangles_of_file(begin + "\n 0\t0 -0 \n\n+1 0 1e-60\r\n0 1e0 0\n\n3 0 1 2"),
            (std::vector<Corners>{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}}));
}

// A file is refused if the buffers through which it is read (file_window.h) do not fit in the
// budget.
TEST(Ply, WindowsAreChargedToTheBudget) {
  const std::string file = plain_triangle(PlyFormat::kLittle);
  EXPECT_THROW(OpenScene(file, {}, 64 << 10), Error);
  OpenScene open(file, {}, 2 << 20);
  EXPECT_EQ(open.triangles(), std::vector<Corners>{kLowHalf});
}

}  // namespace
}  // namespace voxdag::test
