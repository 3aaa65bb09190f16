// Colors and textures of PLY files.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/scene/ply_writer.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using Color = std::array<uint16_t, 4>;

const Color kWhite = {65535, 65535, 65535, 65535};
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kList = "property list uchar int vertex_indices\n";

uint16_t light(double v) {
  const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(linear * 65535));
}
const Color kRed = {light(200 / 255.0), light(60 / 255.0), light(20 / 255.0), 65535};

std::string properties(const std::string& type, const std::vector<std::string>& names) {
  std::string lines;
  for (const std::string& name : names) lines += "property " + type + " " + name + "\n";
  return lines;
}

// Returns a PLY file with three vertices and a face. The arguments are additional properties of the
// vertices and of the face, and their values.
std::string triangle(const std::string& of_vertex, const std::string& vertex_values,
                     const std::string& of_face = "", const std::string& face_values = "",
                     const std::string& comments = "") {
  return "ply\nformat ascii 1.0\n" + comments + "element vertex 3\n" + kXyz + of_vertex +
         "element face 1\n" + kList + of_face + "end_header\n0 0 0 " + vertex_values + "\n1 0 0 " +
         vertex_values + "\n0 1 0 " + vertex_values + "\n3 0 1 2 " + face_values + "\n";
}

std::array<Color, 3> colors_of(const std::string& file) {
  OpenScene open(file);
  const auto all = surfaces_of(*open.source);
  std::array<Color, 3> colors;
  for (size_t k = 0; k < 3; ++k) colors[k] = all.at(0).corners[k].color;
  return colors;
}
Color color_of(const std::string& file) { return colors_of(file)[1]; }

TEST(PlySurfaces, ColorsOfEveryFamily) {
  for (const std::vector<std::string>& names : {std::vector<std::string>{"red", "green", "blue"},
                                                {"r", "g", "b"},
                                                {"diffuse_red", "diffuse_green", "diffuse_blue"},
                                                {"ambient_red", "ambient_green", "ambient_blue"},
                                                {"Red", "Green", "BLUE"}}) {
    EXPECT_EQ(color_of(triangle(properties("uchar", names), "200 60 20")), kRed) << names[0];
    EXPECT_EQ(color_of(triangle("", "", properties("uchar", names), "200 60 20")), kRed);
  }
  const std::string both = properties(
      "uchar", {"ambient_red", "ambient_green", "ambient_blue", "diffuse_red", "diffuse_green",
                "diffuse_blue", "specular_red", "specular_green", "specular_blue"});
  EXPECT_EQ(color_of(triangle(both, "1 2 3 200 60 20 4 5 6")), kRed);
  OpenScene open(triangle(both, "1 2 3 200 60 20 4 5 6"));
  ASSERT_EQ(open.source->materials().warnings.list().size(), 1u);
  EXPECT_NE(open.source->materials().warnings.list()[0].text().find("specular_red"),
            std::string::npos);
}

TEST(PlySurfaces, AlphaOfEveryFamily) {
  for (const auto& [color, alpha] :
       {std::pair{"red green blue", "alpha"}, std::pair{"r g b", "a"},
        std::pair{"red green blue", "a"},
        std::pair{"diffuse_red diffuse_green diffuse_blue", "diffuse_alpha"}}) {
    std::istringstream words(color);
    std::vector<std::string> names(3);
    words >> names[0] >> names[1] >> names[2];
    names.emplace_back(alpha);
    EXPECT_EQ(color_of(triangle(properties("uchar", names), "200 60 20 128"))[3], 128 * 257);
    EXPECT_EQ(color_of(triangle("", "", properties("uchar", names), "200 60 20 0"))[3], 0);
  }
  EXPECT_EQ(color_of(triangle(
                properties("uchar", {"red", "green", "blue"}) + properties("float", {"alpha"}),
                "200 60 20 0.5")),
            (Color{kRed[0], kRed[1], kRed[2], 32768}));
}

// For types other than uchar, the range of the colors (the number that means full intensity)
// follows from the largest number in the file.
TEST(PlySurfaces, RangesOfColors) {
  const auto color = [](const std::string& type, const std::string& values) {
    return color_of(triangle(properties(type, {"red", "green", "blue"}), values));
  };
  for (const char* type : {"float", "double", "ushort", "short", "int", "uint", "int64"}) {
    EXPECT_EQ(color(type, "200 60 20"), kRed) << type;
    EXPECT_EQ(color(type, "51400 15420 5140"), kRed) << type;
  }
  EXPECT_EQ(color("float", "0.5 0.25 1"), (Color{light(0.5), light(0.25), 65535, 65535}));
  EXPECT_EQ(color("float", "0.5 nan 1.25"), (Color{light(0.5), 0, 65535, 65535}));
  EXPECT_EQ(color("float", "199.5 -1 20"), (Color{light(199.5 / 255), 0, kRed[2], 65535}));
  EXPECT_EQ(color("char", "100 -1 2"), (Color{light(100 / 255.0), 0, light(2 / 255.0), 65535}));
  EXPECT_EQ(color_of(triangle("", "", properties("float", {"red", "green", "blue"}), "200 60 20")),
            kRed);
  EXPECT_EQ(color_of(triangle("", "", properties("ushort", {"r", "g", "b"}), "200 60 20")), kRed);
}

TEST(PlySurfaces, ColorsOfVerticesComeBeforeColorsOfFaces) {
  const std::string rgb = properties("uchar", {"red", "green", "blue"});
  const std::string file = triangle(rgb, "200 60 20", rgb, "1 2 3");
  EXPECT_EQ(color_of(file), kRed);
  OpenScene open(file);
  ASSERT_EQ(open.source->materials().warnings.list().size(), 1u);
}

// All triangles of a polygon have its color. Strips have the colors of their vertices.
TEST(PlySurfaces, ColorsOfPolygonsAndStrips) {
  for (const PlyFormat format : kFormats) {
    PlyWriter ply(format);
    ply.header("element vertex 4").header("property float x").header("property float y");
    ply.header("property float z").header("element face 2");
    ply.header("property uchar red").header("property list uchar int vertex_indices");
    ply.header("property uchar green").header("property uchar blue");
    ply.header("element tristrips 1").header("property list int int vertex_indices");
    ply.header("end_header");
    for (const float x : {0.0f, 3.0f, 0.0f, 1.0f})
      ply.put(x).put(x == 1 ? 1.0f : static_cast<float>(ply.text().size() % 2)).put(x).end_row();
    ply.put<uint8_t>(9)
        .put<uint8_t>(3)
        .put_all<int32_t>({0, 1, 2})
        .put_all<uint8_t>({8, 7})
        .end_row();
    ply.put<uint8_t>(200).put<uint8_t>(4).put_all<int32_t>({0, 1, 2, 3});
    ply.put_all<uint8_t>({60, 20}).end_row();
    ply.put<int32_t>(3).put_all<int32_t>({0, 1, 2}).end_row();
    OpenScene open(ply.text());
    const auto all = surfaces_of(*open.source);
    ASSERT_EQ(all.size(), 4u);
    EXPECT_EQ(all[0].corners[0].color[0], light(9 / 255.0));
    EXPECT_EQ(all[1].corners[2].color, kRed);
    EXPECT_EQ(all[2].corners[0].color, kRed);
    EXPECT_EQ(all[3].corners[0].color, kWhite);
  }
}

// A scene of a PLY file, with two images in its folder.
struct TexturedScene {
  explicit TexturedScene(const std::string& file) {
    files.contents["folder/a.ply"] = file;
    files.contents["folder/tex one.png"] = "an image";
    files.contents["folder/b.png"] = "an image";
    source = open_scene(files, {"folder/a.ply"}, {}, budget, cancel);
  }
  SurfaceTriangle triangle(size_t i = 0) { return surfaces_of(*source).at(i); }

  MemoryFiles files;
  MemoryBudget budget{uint64_t{64} << 20};
  CancelToken cancel;
  std::unique_ptr<TriangleSource> source;
};

constexpr int64_t kOne = int64_t{1} << kTextureBits;
const std::string kTexture = "comment TextureFile tex one.png\n";

TEST(PlySurfaces, TexturesOfVertices) {
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}}) {
    TexturedScene scene(triangle(properties("float", names), "0.25 0.125", "", "", kTexture));
    const SurfaceTriangle t = scene.triangle();
    EXPECT_EQ(t.material, 1u);
    EXPECT_EQ(t.corners[0].texture, (std::array<int64_t, 2>{kOne / 4, kOne * 7 / 8}));
    EXPECT_EQ(t.corners[0].color, kWhite);
    const SceneMaterials materials = scene.source->materials();
    EXPECT_EQ(scene.source->material_count(), 2u);
    ASSERT_EQ(materials.images.size(), 1u);
    EXPECT_EQ(materials.images[0].file.path, "folder/tex one.png");
    EXPECT_EQ(materials.materials.at(1).image, 0u);
    EXPECT_EQ(materials.names, std::vector<std::string>{"tex one.png"});
    EXPECT_TRUE(materials.warnings.list().empty());
  }
}

// The corners of a concave polygon keep their texture coordinates.
TEST(PlySurfaces, TexturesOfFaces) {
  const std::string header =
      "ply\nformat ascii 1.0\n" + kTexture + "COMMENT texturefile sub\\b.png\n" +
      "element vertex 4\n" + kXyz + "element face 4\n" + kList +
      "property list uchar float texcoord\nproperty int texnumber\nend_header\n"
      "0 0 0\n4 1 0\n0 2 0\n1 1 0\n";
  TexturedScene scene(header + "4 0 1 2 3 8 0 0 1 .25 0 .5 .25 .25 1\n3 0 1 2 6 0 0 0 0 0 0 7\n" +
                      "3 0 1 2 0 0\n3 0 1 2 6 0 0 0 0 1 1 0\n");
  const auto all = surfaces_of(*scene.source);
  ASSERT_EQ(all.size(), 5u);
  for (size_t i = 0; i < 2; ++i)
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(all[i].material, 2u);
      const double* const p = all[i].position.v[k];
      EXPECT_EQ(all[i].corners[k].texture[0], static_cast<int64_t>(p[0] / 4 * kOne));
      EXPECT_EQ(all[i].corners[k].texture[1], static_cast<int64_t>((1 - p[1] / 4) * kOne));
    }
  EXPECT_EQ(all[2].material, 0u);
  EXPECT_EQ(all[3].material, 0u);
  EXPECT_EQ(all[4].material, 1u);
  const SceneMaterials materials = scene.source->materials();
  ASSERT_EQ(materials.images.size(), 2u);
  EXPECT_EQ(materials.images[1].file.path, "folder/b.png");
  ASSERT_EQ(materials.warnings.list().size(), 1u);
  EXPECT_NE(materials.warnings.list()[0].text().find("face 1: has no texture coordinates"),
            std::string::npos);
}

// If its image is missing, a triangle has the colors of its vertices.
TEST(PlySurfaces, MissingTextures) {
  const std::string values =
      properties("uchar", {"red", "green", "blue"}) + properties("float", {"s", "t"});
  TexturedScene missing(triangle(values, "200 60 20 0 0", "", "", "comment TextureFile no.png\n"));
  EXPECT_EQ(missing.triangle().material, 0u);
  EXPECT_EQ(missing.triangle().corners[0].color, kRed);
  EXPECT_NE(missing.source->materials().images.at(0).problem.find("cannot be opened"),
            std::string::npos);
  TexturedScene present(triangle(values, "200 60 20 0 0", "", "", kTexture));
  EXPECT_EQ(present.triangle().material, 1u);
  EXPECT_EQ(present.triangle().corners[0].color, kWhite);
  TexturedScene unused(triangle("", "", "", "", kTexture));
  EXPECT_EQ(unused.triangle().material, 0u);
  ASSERT_EQ(unused.source->materials().warnings.list().size(), 1u);
  for (const char* name : {"/etc/passwd", "C:\\no.png", "http://a/no.png", ""}) {
    TexturedScene absolute(triangle(values, "200 60 20 0 0", "", "",
                                    std::string("comment TextureFile ") + name + "\n"));
    EXPECT_FALSE(absolute.source->materials().images.at(0).problem.empty());
  }
}

}  // namespace
}  // namespace voxdag::test
