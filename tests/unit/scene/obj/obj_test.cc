// Reads OBJ files made by the tests. Every form of a statement gives the triangles of the same
// mesh, and broken files are refused with an error that names the line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene/textures/linear_light.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Channels = std::array<uint16_t, 4>;

const Corners kLower = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
const Corners kUpper = {{{0, 0, 0}, {0, 1, 0}, {-1, 1, 0}}};
const std::string kVertexLines = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

std::vector<std::string> warnings_of(const std::string& file) {
  OpenScene open(file);
  open.triangles();
  return texts_of(open.source->warnings());
}

TEST(Obj, FacesInEveryForm) {
  const std::string others = "vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n";
  for (const char* face :
       {"f 1 2 3", "f 1/1 2/2 3/3", "f 1//1 2//1 3//1", "f 1/1/1 2/2/1 3/3/1", "f 1/ 2/ 3//",
        "f -3 -2 -1", "f -3/-3/-1 -2/-2/-1 -1/-1/-1", "f\t1  2\t3 ", "f +1 2 3 # comment",
        "fo 1 2 3", "  f 1 2 3", "f 1 2 \\\n  3", "f 1 2 \\ \r\n3"})
    EXPECT_EQ(triangles_of_file(kVertexLines + others + face), std::vector<Corners>{kLower})
        << face;
}

TEST(Obj, VerticesWithoutFaces) {
  EXPECT_THAT(warnings_of(kVertexLines), ElementsAre(HasSubstr("vertices without faces")));
  EXPECT_THAT(warnings_of(kVertexLines + "p 1\n"), ElementsAre(HasSubstr("points and lines")));
}

TEST(Obj, LineEndsAndByteOrderMark) {
  const std::string text = "# comment \\\n" + kVertexLines + "f 1 2 3\n";
  for (const char* line_end : {"\n", "\r\n", "\r"}) {
    std::string file;
    for (const char c : text) file += c == '\n' ? line_end : std::string(1, c);
    EXPECT_EQ(triangles_of_file(file), std::vector<Corners>{kLower});
    file.resize(file.size() - std::string_view(line_end).size());
    EXPECT_EQ(triangles_of_file("\xef\xbb\xbf" + file), std::vector<Corners>{kLower});
  }
  EXPECT_EQ(triangles_of_file("v 0 0 0\r\nv 1 0 0\rv 0 1 0\nf 1 2 3"),
            std::vector<Corners>{kLower});
}

// A positive index counts all vertices of the file, including vertices after the face. A negative
// index counts back from the face.
TEST(Obj, IndicesBeforeAndAfterTheFace) {
  const std::string file = "f 1 2 3\n" + kVertexLines + "o second\nv 9 9 9\nf -4 -2 5\nv -1 1 0\n";
  EXPECT_EQ(triangles_of_file(file), (std::vector<Corners>{kLower, kUpper}));
}

TEST(Obj, NumbersAreTheNearestDoubles) {
  const std::string numbers = "0.1 +2.5e-3 123456789.123456789";
  const auto triangles = triangles_of_file("v " + numbers + "\nf 1 1 1\n");
  EXPECT_EQ(triangles.at(0)[0], (std::array<double, 3>{0.1, 2.5e-3, 123456789.123456789}));
}

TEST(Obj, StatementsWithoutVoxelsAreIgnored) {
  const std::string file = "o a\ng b c\ns off\nvp 0 0\nlod 2\nmg 1 2\n" + kVertexLines;
  EXPECT_TRUE(warnings_of(file + "f 1 2 3").empty());
  const auto warnings =
      warnings_of(file + "l 1 2\np 1\nf 1 2\nhello world\nf 1 2 3\nl 2 3\nnews\n");
  EXPECT_THAT(
      warnings,
      ElementsAre("folder/scene: line 12: a face of fewer than three corners makes no voxels",
                  AllOf(HasSubstr("line 10: points and lines"), HasSubstr("(3 times)")),
                  AllOf(HasSubstr("line 13"), HasSubstr("\"hello\""), HasSubstr("(2 times)"))));
}

TEST(Obj, StatementsWithoutNames) {
  EXPECT_THAT(warnings_of("mtllib \n" + kVertexLines + "usemtl\nf 1 2 3\nusemtl\t\n"),
              ElementsAre("folder/scene: line 5: usemtl has no name; its faces are white (2 times)",
                          "folder/scene: line 1: mtllib has no name; it is ignored"));
}

// Old editors end a text with Ctrl-Z or with NUL bytes.
TEST(Obj, MarksAtTheEnd) {
  for (const std::string& mark : {std::string("\x1a"), std::string("\n\x1a"), std::string("\0", 1),
                                  std::string("\n\0\0", 3), "\r\n\x1a" + std::string(300, '\0')}) {
    OpenScene open(kVertexLines + "f 1 2 3" + mark);
    EXPECT_EQ(open.triangles(), std::vector<Corners>{kLower});
    EXPECT_TRUE(open.source->warnings().empty());
  }
  EXPECT_THAT(warnings_of(kVertexLines + "\x1a\nf 1 2 3\n"), ElementsAre(HasSubstr("unknown")));
}

TEST(Obj, FaultsNameTheLine) {
  const auto message = [](const std::string& file) { return error_of_file(file).message(); };
  EXPECT_EQ(message(kVertexLines + "f 1 2 4\n"),
            "folder/scene: face 0 in line 4: index 4 does not exist, there are 3 vertices");
  EXPECT_THAT(message(kVertexLines + "\nf 1 2 -4\n"), HasSubstr("face 0 in line 5: index -4"));
  EXPECT_THAT(message(kVertexLines + "f 1 2 0\n"), HasSubstr("index 0"));
  EXPECT_THAT(message(kVertexLines + "f 1 2 99999999999999999999\n"),
              HasSubstr("index 99999999999999999999 does not exist"));
  EXPECT_THAT(message(kVertexLines + "f 1 2 -9007199254740993/1\n"),
              HasSubstr("index -9007199254740993 does not exist"));
  EXPECT_THAT(message(kVertexLines + "f 1 2 3\nf 1,2,3\n"),
              HasSubstr("face 1 in line 5: corner 0 is 1,2,3, expected v, v/vt, v//vn or v/vt/vn"));
  EXPECT_THAT(message(kVertexLines + "f 1 2/x\n"), HasSubstr("corner 1 is 2/x, expected"));
  EXPECT_THAT(message(kVertexLines + "f 1 2 x\n"), HasSubstr("face 0 in line 4: corner 2 is x"));
  EXPECT_THAT(message(kVertexLines + "f 1 2 3;\n"), HasSubstr("corner 2 is 3;"));
  EXPECT_THAT(message("v 0 0\nvn 0 0 1\nf 1 1 1\n"),
              HasSubstr("vertex 0 in line 1 has 2 numbers, expected three"));
  EXPECT_THAT(message("v 0 0 0\nv 0 0,5 0\nf 1 1 2\n"),
              HasSubstr("vertex 1 in line 2 has 0,5, expected a number"));
  EXPECT_THAT(message("v 0 0 nan\nf 1 1 1\n"), HasSubstr("vertex 1 is not a finite position"));
  EXPECT_THAT(message("v 1e999 0 0\nf 1 1 1\n"), HasSubstr("is not a finite position"));
  EXPECT_THAT(message(kVertexLines + "cstype bspline\ndeg 3\ncurv 0 1 1 2 3\n"),
              HasSubstr("line 4: cstype is part of a free-form curve"));
  EXPECT_THAT(message(kVertexLines + "call more.obj\n"), HasSubstr("line 4: call includes"));
}

TEST(Obj, InvalidFacesCanBeDropped) {
  OpenScene open(kVertexLines + "v inf 0 0\nf 1 2 4\nf 1 2 9\nf 1 2 3\nf 0 1 2\n",
                 {.skip_invalid = true});
  EXPECT_EQ(open.source->declared_triangles(), 4u);
  EXPECT_EQ(open.triangles(), std::vector<Corners>{kLower});
}

TEST(Obj, LongLines) {
  const std::string comment = "#" + std::string(3 << 20, 'x') + "\n";
  EXPECT_EQ(triangles_of_file(kVertexLines + comment + comment + "f 1 2 3"),
            std::vector<Corners>{kLower});
  std::string many = "f";
  for (int i = 0; i < 30000; ++i) many += " 1 2 3";
  EXPECT_EQ(error_of_file(kVertexLines + many).code(), ErrorCode::kLimit);
  many.clear();
  for (int i = 0; i < 10000; ++i) many += " 1/1/1 2/2/2 3/3/3";
  EXPECT_EQ(triangles_of_file(kVertexLines + "f" + many).size(), 29998u);
  const Error error = error_of_file(kVertexLines + "f " + std::string(2 << 20, ' ') + "1 2 3");
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_THAT(error.message(), HasSubstr("line 4 has over 1048576 bytes"));
}

// Reads thousands of convex faces of 0 to 9 corners, with vertices between them. The triangles are
// the same if reading begins at any triangle.
TEST(Obj, TrianglesFromAnyNumberOn) {
  std::string file;
  std::vector<Corners> expected;
  const auto vertex = [](int i) { return std::array<double, 3>{double(i), double(i * i), 1}; };
  for (int i = 0; i < 5000; ++i) {
    file += "v " + std::to_string(i) + " " + std::to_string(i * i) + " 1\n";
    if (i < 10) continue;
    const int corners = i % 10;
    file += "f";
    for (int k = 0; k < corners; ++k)
      file += " " + std::to_string(i % 2 == 0 ? -(k + 1) : i - k + 1);
    file += "\n";
    for (int k = 2; k < corners; ++k)
      expected.push_back({vertex(i), vertex(i - k + 1), vertex(i - k)});
  }
  OpenScene open(file);
  ASSERT_EQ(open.source->declared_triangles(), expected.size());
  EXPECT_EQ(open.triangles(), expected);
  const auto cursor = open.source->open(2);
  for (uint64_t first = expected.size(); first-- > 0; first -= std::min<uint64_t>(first, 997))
    cursor->read(first, 1, [&](auto batch) {
      EXPECT_EQ(batch[0].v[2][0], expected[static_cast<size_t>(first)][2][0]);
    });
}

// --- Colors and materials ---------------------------------------------------------------------

struct Library {
  std::string name, text;
};

// An OBJ file with libraries in its folder.
struct WithLibraries : OpenScene {
  WithLibraries(const std::string& file, const std::vector<Library>& libraries)
      : OpenScene("v 0 0 0\nf 1 1 1\n") {
    for (const Library& library : libraries) files.contents[library.name] = library.text;
    files.contents["folder/scene"] = file;
    source = open_scene(files, {"folder/scene"}, {}, budget, cancel);
  }
};

TEST(Obj, VertexColors) {
  const auto colors_of = [](const std::string& lines) {
    OpenScene open(lines + "f 1 1 1\nf 2 2 2\n");
    const auto all = surfaces_of(*open.source);
    return std::pair(all.at(0).corners[0].color, all.at(1).corners[0].color);
  };
  const uint16_t half = linear_light(0.5), byte = linear_light(51 / 255.0);
  EXPECT_EQ(colors_of("v 0 0 0 0.5 0 1\nv 0 0 0\n"),
            (std::pair(Channels{half, 0, 65535, 65535}, Channels{65535, 65535, 65535, 65535})));
  EXPECT_EQ(
      colors_of("v 0 0 0 1 0 0 0.2\nv 0 0 0 51 0 300\n"),
      (std::pair(Channels{linear_light(1 / 255.0), 0, 0, 51}, Channels{byte, 0, 65535, 65535})));
  EXPECT_EQ(colors_of("v 0 0 0 0.5\nv 0 0 0 1.0\n").first, (Channels{65535, 65535, 65535, 65535}));
}

const std::string kTriangleLines = kVertexLines + "vt 0 0\nvt 1 0\nvt 0.5 0.25 0\n";

// The warning about a library that is compressed or in another encoding names its format.
TEST(Obj, LibrariesThatAreNoText) {
  const auto warnings_of_library = [](const std::string& text) {
    const WithLibraries open("mtllib a.mtl\n" + kTriangleLines + "f 1 2 3\n",
                             {{"folder/a.mtl", text}});
    return texts_of(open.source->materials().warnings.list());
  };
  const std::string zero(1, '\0');
  EXPECT_THAT(warnings_of_library("\x1f\x8b\x08 compressed"),
              ElementsAre(HasSubstr("mtllib a.mtl cannot be opened (folder/a.mtl: is compressed by "
                                    "gzip: unpack it first); its materials are white")));
  EXPECT_THAT(warnings_of_library("\xff\xfe#" + zero + "a" + zero),
              ElementsAre(HasSubstr("is text in UTF-16LE: convert it first")));
  EXPECT_THAT(warnings_of_library("newmtl a\n\x01\n"), ElementsAre(HasSubstr("is not a text")));
  EXPECT_TRUE(warnings_of_library("newmtl a\nKd 1 0 0\n\x1a" + zero).empty());
  EXPECT_THAT(warnings_of_library("Ns 3\nKd 1 0 0\nmap_kd a.png\nnewmtl a\n"),
              ElementsAre(HasSubstr("line 2: Kd precedes the first newmtl; it is ignored"),
                          HasSubstr("line 3: map_kd precedes the first newmtl")));
  EXPECT_THAT(warnings_of_library("newmtl \nnewmtl a\nd x\nTr\nmap_Kd -s 1 1 1\n"),
              ElementsAre(HasSubstr("line 1: newmtl has no name"),
                          HasSubstr("line 3: d has x, expected a number; it is ignored"),
                          HasSubstr("line 4: Tr has nothing, expected a number"),
                          HasSubstr("line 5: map_Kd has no name of an image")));
}

TEST(Obj, MaterialsOfLibraries) {
  const std::string file = "mtllib my colors.mtl second.mtl\n" + kTriangleLines +
                           "f 1 2 3\nusemtl red paint\nf 1 2 3\nusemtl glass # comment\nf 1 2 3\n"
                           "usemtl missing\nf 1 2 3\n";
  const WithLibraries open(
      file, {{"folder/my colors.mtl",
              "newmtl red paint\nKd 1 0 0\nNs 3\nnewmtl glass\nkd 0.5\nd 0.25\nTr 0.1\n"},
             {"folder/second.mtl", "newmtl glass\nKd 0 0 0\nnewmtl unused\nmap_Kd no.png\n"}});
  const SceneMaterials materials = open.source->materials();
  EXPECT_EQ(materials.names, (std::vector<std::string>{"red paint", "glass", "unused", "missing"}));
  EXPECT_TRUE(materials.images.empty());
  EXPECT_THAT(texts_of(materials.warnings.list()),
              ElementsAre(HasSubstr("\"missing\": the material is in no library")));
  const auto all = surfaces_of(*open.source);
  ASSERT_EQ(all.size(), 4u);
  const auto material = [&](size_t i) { return materials.materials.at(all[i].material); };
  EXPECT_EQ(material(0), Material{});
  EXPECT_EQ(material(1).factor, (Channels{65535, 0, 0, 65535}));
  EXPECT_EQ(material(1).name, "red paint");
  const uint16_t half = linear_light(0.5);
  EXPECT_EQ(material(2).factor, (Channels{half, half, half, 16384}));
  EXPECT_EQ(material(2).alpha_mode, AlphaMode::kBlend);
  EXPECT_EQ(material(3).name, "missing");
  EXPECT_EQ(open.source->files().size(), 3u);
  EXPECT_EQ(open.source->material_count(), materials.materials.size());
}

TEST(Obj, TextureCoordinatesRunUpward) {
  const std::string file = "mtllib a.mtl\n" + kTriangleLines +
                           "usemtl wood\nf 1/1 2/2 3/3\nf 1 2 3\nf 1/1 2/2 3/9\nusemtl tile\n"
                           "f 1/1 2/2 3/3\n";
  const WithLibraries open(
      file, {{"folder/a.mtl",
              "newmtl wood\nmap_Kd -blendu on textures\\my wood.png\nKd 0 0 0\nnewmtl tile\n"
              "map_Kd -s 2 4 1 -o 0.5 -clamp on -cc on textures/my wood.png\n"},
             {"folder/textures/my wood.png", "image"}});
  const SceneMaterials materials = open.source->materials();
  const auto all = surfaces_of(*open.source);
  ASSERT_EQ(all.size(), 4u);
  constexpr int64_t kOne = int64_t{1} << kTextureBits;
  EXPECT_EQ(all[0].corners[0].texture, (std::array<int64_t, 2>{0, kOne}));
  EXPECT_EQ(all[0].corners[2].texture, (std::array<int64_t, 2>{kOne / 2, kOne / 4 * 3}));
  EXPECT_EQ(all[3].corners[2].texture, (std::array<int64_t, 2>{kOne / 2 * 3, 0}));
  const auto material = [&](size_t i) { return materials.materials.at(all[i].material); };
  EXPECT_EQ(material(0).factor, (Channels{65535, 65535, 65535, 65535}));
  ASSERT_NE(material(0).image, Material::kNoImage);
  EXPECT_EQ(materials.images.at(material(0).image).file.path, "folder/textures/my wood.png");
  EXPECT_EQ(materials.images.at(material(0).image).problem, "");
  EXPECT_EQ(material(1).image, Material::kNoImage);
  EXPECT_EQ(material(2).image, Material::kNoImage);
  EXPECT_EQ(material(3).wrap[0], Wrap::kClampToEdge);
  EXPECT_THAT(texts_of(materials.warnings.list()),
              ElementsAre(HasSubstr("a.mtl: line 5: the options -cc of map_Kd are ignored"),
                          HasSubstr("\"wood\": its Kd is black"),
                          HasSubstr("\"wood\": a face has no texture coordinates")));
  EXPECT_EQ(materials.warnings.list()[2].count, 2u);
}

// Returns the number of faces that the warning missing-texture-coordinates counts.
uint64_t count_without_texture(const std::string& faces) {
  const WithLibraries open("mtllib a.mtl\n" + kTriangleLines + "v 1 1 0\nusemtl a\n" + faces,
                           {{"folder/a.mtl", "newmtl a\nmap_Kd a.png\n"}, {"folder/a.png", ""}});
  const SceneMaterials materials = open.source->materials();
  for (const Warning& warning : materials.warnings.list())
    if (warning.code == "missing-texture-coordinates") return warning.count;
  return 0;
}

// Counts the faces that have a corner without texture coordinates, or a corner whose index refers
// to no vt statement. kTriangleLines has three vt statements.
TEST(Obj, FacesWithoutTextureAreCounted) {
  EXPECT_EQ(count_without_texture("f 1/1 2/2 3/3\nf 1/-3 2/-2 3/-1\n"), 0u);
  EXPECT_EQ(count_without_texture("f 1/4 2/2 3/3\nvt 0 0\n"), 0u);
  EXPECT_EQ(count_without_texture("f 1/1 2/2 3\nf 1 2 3\nf 1/1 2/2 4/0\n"), 3u);
  EXPECT_EQ(count_without_texture("f 1/-4 2/-2 3/-1\nf 1/1 2/2 3/3\n"), 1u);
  EXPECT_EQ(count_without_texture("f 1/1 2/4 3/3\nf 1/1 2/2 3/3\nf 1/5 2/2 4/1 3/3\nvt 0 0\n"), 1u);
}

TEST(Obj, MissingFilesAreWarnings) {
  const WithLibraries open(
      "mtllib none.mtl\nmtllib C:\\models\\a.mtl\n" + kTriangleLines + "usemtl a\nf 1/1 2/2 3/3\n",
      {{"folder/a.mtl", "newmtl a\nmap_Kd /etc/passwd\nnewmtl a\nmap_Kd ../out.png\n"}});
  const SceneMaterials materials = open.source->materials();
  EXPECT_THAT(texts_of(materials.warnings.list()),
              ElementsAre(HasSubstr("line 1: mtllib none.mtl cannot be opened"),
                          HasSubstr("material \"a\" is defined again")));
  ASSERT_EQ(materials.images.size(), 1u);
  EXPECT_THAT(materials.images[0].problem, HasSubstr("cannot be opened"));
  EXPECT_EQ(surfaces_of(*open.source).size(), 1u);
}

TEST(Obj, LfsPointersAreNotLibraries) {
  const WithLibraries open(
      "mtllib a.mtl\n" + kTriangleLines + "usemtl a\nf 1/1 2/2 3/3\n",
      {{"folder/a.mtl", "version https://git-lfs.github.com/spec/v1\noid sha256:0\n"}});
  const SceneMaterials materials = open.source->materials();
  EXPECT_THAT(texts_of(materials.warnings.list()),
              ElementsAre(HasSubstr("a.mtl is a Git LFS pointer, not the file itself"),
                          HasSubstr("material \"a\"")));
}

// --- Recognition ------------------------------------------------------------------------------

TEST(Obj, IsRecognizedByItsStatements) {
  const auto is_obj = [](const std::string& file) {
    OpenScene open("v 0 0 0\nf 1 1 1\n");
    open.files.contents["x"] = file;
    for (const SceneFormat& format : scene_formats())
      if (format.name == "OBJ") return format.sniff(*open.files.open_read("x"));
    return false;
  };
  for (const char* text : {"v 0 0 0", "# a\n\no b\nvt 0\n", "mtllib a.mtl",
                           "g x\nusemtl y\nf 1 2 3", "\xef\xbb\xbf# x\rvn 0 0 1"})
    EXPECT_TRUE(is_obj(text)) << text;
  for (const char* text : {"", "# only a comment", "1 2 3\n4 5 6\n", "version https://git-lfs", "v",
                           "o name\n", "solid a\n", "OFF\n3 1 0\n", "{\"asset\": 1}", "newmtl a\n"})
    EXPECT_FALSE(is_obj(text)) << text;
  EXPECT_FALSE(is_obj("#" + std::string(2 << 20, 'x') + "\nv 0 0 0\n"));
  EXPECT_FALSE(is_obj(std::string("\x1f\x8b\x08\x00v 0 0 0\n", 12)));
}

}  // namespace
}  // namespace voxdag::test
