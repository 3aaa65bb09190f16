// The buffers of a scene: external files, data: URIs, the binary chunk.
#include <gtest/gtest.h>

#include <cctype>
#include <filesystem>
#include <fstream>

#include "scene/base64.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

// Opens folder/scene in a file system with these files, and reads its triangles.
std::vector<Corners> triangles_among(const std::map<std::string, std::string>& contents) {
  MemoryFiles files;
  files.contents = contents;
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  return triangles_of(*open_scene(files, {"folder/scene"}, {}, budget, cancel));
}

Error error_among(const std::map<std::string, std::string>& contents) {
  try {
    triangles_among(contents);
  } catch (const Error& e) {
    return e;
  }
  return Error(ErrorCode::kInvalidInput, "");
}

// An external buffer is a file in the folder of the scene; its name is percent-encoded.
TEST(GltfBuffers, External) {
  const SceneBuilder scene = one_triangle();
  EXPECT_EQ(triangles_among({{"folder/scene", scene.gltf("sub%20dir/my%2fb.bin")},
                             {"folder/sub dir/my/b.bin", scene.bin}})
                .size(),
            1u);
}

TEST(GltfBuffers, ExternalThatIsMissingOrShort) {
  const SceneBuilder scene = one_triangle();
  const Error missing = error_among({{"folder/scene", scene.gltf("a.bin")}});
  EXPECT_EQ(missing.code(), ErrorCode::kNotFound);
  EXPECT_NE(missing.message().find("folder/scene: buffer 0: "), std::string::npos);
  const Error cut =
      error_among({{"folder/scene", scene.gltf("a.bin")}, {"folder/a.bin", scene.bin.substr(1)}});
  EXPECT_EQ(cut.code(), ErrorCode::kInvalidInput);
  EXPECT_NE(cut.message().find("buffer 0 has 41 bytes in a.bin, expected 42"), std::string::npos)
      << cut.message();
}

// A buffer file that is replaced while the scene is read is an error, so two files are never mixed.
TEST(GltfBuffers, ExternalThatIsReplacedWhileTheSceneIsRead) {
  const SceneBuilder builder = one_triangle();
  const TemporaryFolder folder;
  const auto write = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder.file(name), std::ios::binary) << bytes;
  };
  write("scene.gltf", builder.gltf("a.bin"));
  write("a.bin", builder.bin);
  MemoryBudget budget(uint64_t{64} << 20);
  CancelToken cancel;
  const auto scene = open_scene(system_files(), {folder.file("scene.gltf")}, {}, budget, cancel);
  EXPECT_EQ(triangles_of(*scene).size(), 1u);
  write("b.bin", builder.bin);
  std::filesystem::rename(folder.file("b.bin"), folder.file("a.bin"));
  const Error error = error_of([&] { triangles_of(*scene); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  EXPECT_NE(error.message().find("a.bin changed while the scene was read"), std::string::npos)
      << error.message();
}

// A buffer that is not needed for triangles (here it has normals) can be missing.
TEST(GltfBuffers, ExternalThatIsNotRead) {
  SceneBuilder scene = one_triangle();
  scene.root["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 36}});
  const int normals = scene.add(
      "accessors", {{"bufferView", 2}, {"componentType", kF32}, {"count", 3}, {"type", "VEC3"}});
  scene.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals;
  scene.root["buffers"] = {{{"byteLength", scene.bin.size()}, {"uri", "a.bin"}},
                           {{"byteLength", 36}, {"uri", "normals.bin"}}};
  EXPECT_EQ(
      triangles_among({{"folder/scene", scene.root.dump()}, {"folder/a.bin", scene.bin}}).size(),
      1u);
}

// Only relative paths are followed.
TEST(GltfBuffers, UrisThatAreNotFollowed) {
  for (const char* uri :
       {"", "/etc/passwd", "http://example.org/a.bin", "file:a.bin", "C:\\a.bin", "a%00b"}) {
    const Error error = error_among({{"folder/scene", one_triangle().gltf(uri)}});
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput) << uri;
    EXPECT_NE(error.message().find("buffer 0: its uri"), std::string::npos) << error.message();
  }
}

// A buffer's file is found even if its URI lacks the percent-encoding that RFC 3986 requires, or
// has a query or a fragment.
TEST(GltfBuffers, UrisOfOtherPrograms) {
  const std::pair<const char*, const char*> names[] = {{"mesh.bin?v=3", "mesh.bin"},
                                                       {"mesh.bin#part", "mesh.bin"},
                                                       {"mesh.bin?t=12:30#a", "mesh.bin"},
                                                       {"mesh.bin?v=3", "mesh.bin?v=3"},
                                                       {"sub\\mesh.bin", "sub/mesh.bin"},
                                                       {"sub\\my%20mesh.bin?v", "sub/my mesh.bin"},
                                                       {"sub%5Cmesh.bin", "sub/mesh.bin"},
                                                       {"sub\\mesh.bin", "sub\\mesh.bin"},
                                                       {"example 10%.bin", "example 10%.bin"},
                                                       {"a%2.bin", "a%2.bin"},
                                                       {"a%zz%20b", "a%zz b"},
                                                       {"100%25.bin", "100%25.bin"},
                                                       {"100%25.bin", "100%.bin"},
                                                       {"a b+c.bin", "a b+c.bin"},
                                                       {".\\mesh.bin", "./mesh.bin"},
                                                       {"10:30 o'clock.bin", "10:30 o'clock.bin"}};
  const SceneBuilder scene = one_triangle();
  for (const auto& [uri, name] : names)
    EXPECT_EQ(triangles_among(
                  {{"folder/scene", scene.gltf(uri)}, {std::string("folder/") + name, scene.bin}})
                  .size(),
              1u)
        << uri;
}

// A file with the URI's exact name is preferred. If no file exists, the error has the exact name.
TEST(GltfBuffers, TheExactNameComesFirst) {
  const SceneBuilder scene = one_triangle();
  EXPECT_EQ(triangles_among({{"folder/scene", scene.gltf("a.bin?b")},
                             {"folder/a.bin?b", scene.bin},
                             {"folder/a.bin", ""}})
                .size(),
            1u);
  const Error missing = error_among({{"folder/scene", scene.gltf("sub\\a.bin?b")}});
  EXPECT_EQ(missing.code(), ErrorCode::kNotFound);
  EXPECT_NE(missing.message().find("sub\\a.bin?b"), std::string::npos) << missing.message();
}

// A path that begins with backslashes must not be read as an absolute path.
TEST(GltfBuffers, BackslashesDoNotMakeAbsolutePaths) {
  const SceneBuilder scene = one_triangle();
  for (const char* uri : {"\\etc\\a.bin", "\\\\host\\a.bin", "%5Cetc%5Ca.bin"})
    EXPECT_EQ(error_among({{"folder/scene", scene.gltf(uri)},
                           {"/etc/a.bin", scene.bin},
                           {"folder//etc/a.bin", scene.bin},
                           {"//host/a.bin", scene.bin}})
                  .code(),
              ErrorCode::kNotFound)
        << uri;
}

// If a Git LFS pointer replaces a buffer's file, the error mentions this, for any declared length.
TEST(GltfBuffers, LfsPointers) {
  const std::string pointer =
      "version https://git-lfs.github.com/spec/v1\noid sha256:0123456789abcdef0123456789abcdef"
      "0123456789abcdef0123456789abcdef\nsize 42\n";
  for (const size_t length : {size_t{0}, size_t{1000}}) {
    SceneBuilder scene = one_triangle();
    scene.bin.resize(scene.bin.size() + length);
    const Error error =
        error_among({{"folder/scene", scene.gltf("a.bin")}, {"folder/a.bin", pointer}});
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_EQ(error.message(),
              "folder/scene: buffer 0: folder/a.bin is a Git LFS pointer, not the file itself: run "
              "git lfs pull");
  }
}

// Strings of many megabytes take no memory, so the scene fits in a far smaller budget. The
// exception is strings with escapes: the parser collects and charges them, and refuses the file if
// they do not fit.
TEST(GltfBuffers, LongStringsTakeNoMemory) {
  SceneBuilder scene = one_triangle();
  const std::string picture = "data:image/png;base64," + std::string(3000000, 'A');
  scene.root["images"] = {{{"uri", picture}}};
  scene.root["nodes"][0]["name"] = std::string(3000000, 'x') + "\u00e4";
  scene.root["asset"]["generator"] = std::string(3000000, '\t');
  scene.root["extras"] = {{std::string(3000000, 'k'), 1}};
  EXPECT_THROW(OpenScene(scene.glb(), {}, uint64_t{1} << 20), Error);
  scene.root["asset"].erase("generator");
  EXPECT_EQ(OpenScene(scene.glb(), {}, uint64_t{1} << 20).triangles().size(), 1u);
}

// Thousands of nodes, meshes and accessors are read within a small budget, and keep their order.
TEST(GltfBuffers, LargeStructure) {
  constexpr int kCount = 20000;
  SceneBuilder scene;
  const int view = scene.add_view<float>(std::vector<float>(9 + kCount, 1));
  for (int i = 0; i < kCount; ++i) {
    scene.add("accessors", {{"bufferView", view},
                            {"byteOffset", 4 * i},
                            {"componentType", kF32},
                            {"count", 3},
                            {"type", "VEC3"}});
    scene.add_mesh({{"attributes", {{"POSITION", i}}}, {"indices", 0}});
    scene.add_root({{"mesh", kCount - 1 - i}, {"translation", {i, 0, 0}}});
  }
  const int indices = scene.add_accessor<uint16_t>("SCALAR", kU16, {0, 1, 2});
  for (Json& mesh : scene.root["meshes"]) mesh["primitives"][0]["indices"] = indices;
  OpenScene open(scene.glb(), {}, uint64_t{24} << 20);
  const auto triangles = open.triangles();
  ASSERT_EQ(triangles.size(), size_t{kCount});
  for (int i = 0; i < kCount; ++i) ASSERT_EQ(triangles[static_cast<size_t>(i)][0][0], i + 1.0);
}

// A buffer without a uri is an error, unless it is the first buffer of a GLB.
TEST(GltfBuffers, WithoutUri) {
  SceneBuilder scene = one_triangle();
  scene.root["buffers"] = {{{"byteLength", scene.bin.size()}}};
  const Error error = error_of_file(scene.root.dump());
  EXPECT_NE(error.message().find("buffer 0 has no uri and is not in the file"), std::string::npos);
}

// Reads a data: URI that is longer than the windows in which a file is read. The pieces begin at
// every remainder modulo 3.
TEST(GltfBuffers, LongDataUri) {
  constexpr size_t kTriangles = 40000;
  std::vector<float> positions;
  for (size_t i = 0; i < 9 * kTriangles; ++i) positions.push_back(static_cast<float>(i % 1013));
  for (size_t shift : {0, 1, 2}) {
    SceneBuilder scene;
    const int accessor = scene.add_positions(positions);
    scene.add_root({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", accessor}}}})}});
    scene.bin.insert(0, shift, 'x');
    scene.root["bufferViews"][0]["byteOffset"] = shift;
    const auto triangles =
        triangles_of_file(scene.gltf("data:application/octet-stream;base64," + base64(scene.bin)));
    ASSERT_EQ(triangles.size(), kTriangles);
    for (size_t i = 0; i < 9 * kTriangles; ++i)
      ASSERT_EQ(triangles[i / 9][i / 3 % 3][i % 3], positions[i]) << i;
  }
}

// In the JSON, the base64 characters of a data: URI can be written as escapes, as some exporters
// do.
TEST(GltfBuffers, DataUriWithJsonEscapes) {
  SceneBuilder scene = one_triangle();
  for (int i = 0; i < 10000; ++i) scene.bin += static_cast<char>(i * i % 251);
  const std::string text = base64(scene.bin);
  std::string escaped;
  for (char c : text) escaped += c == 'A' ? "\\u0041" : c == '/' ? "\\/" : std::string(1, c);
  ASSERT_NE(escaped, text);
  std::string file = scene.gltf("data:;base64,HERE");
  file.replace(file.find("HERE"), 4, escaped);
  EXPECT_EQ(triangles_of_file(file).size(), 1u);
}

// Reads data: URIs in forms that RFC 2397 does not allow, and percent-encoded ones.
TEST(GltfBuffers, DataUrisOfOtherPrograms) {
  SceneBuilder scene = one_triangle();
  for (int i = 0; i < 300; ++i) scene.bin += static_cast<char>(i);
  const std::string text = base64(scene.bin);
  std::string broken_lines, url_safe, escaped, percent;
  for (size_t i = 0; i < text.size(); ++i) {
    broken_lines += (i % 76 == 75 ? "\r\n" : "") + text.substr(i, 1);
    url_safe += text[i] == '+' ? '-' : text[i] == '/' ? '_' : text[i];
    escaped += text[i] == '/' ? "%2F" : text[i] == '+' ? "%2b" : text.substr(i, 1);
  }
  for (const unsigned char c : scene.bin) {
    const char* const digits = "0123456789ABCDEF";
    const bool is_plain = std::isalnum(c) || c == '-';
    percent += is_plain ? std::string(1, static_cast<char>(c))
                        : std::string{'%', digits[c / 16], digits[c % 16]};
  }
  const std::string unpadded = url_safe.substr(0, url_safe.find('='));
  ASSERT_NE(unpadded, text);
  for (const std::string& uri :
       {"data:application/octet-stream;base64,\n  " + broken_lines + "\n",
        "data:;base64," + text.substr(0, 60) + " \t" + text.substr(60), "data:;base64," + url_safe,
        "data:;base64," + unpadded, "data:;base64," + escaped,
        "DATA:application/octet-stream;BASE64," + text,
        "data:application/gltf-buffer;charset=utf-8; base64 ," + text,
        "data:application/octet-stream," + percent, "data:," + percent})
    EXPECT_EQ(triangles_of_file(scene.gltf(uri)), triangles_of_file(one_triangle().glb()))
        << uri.substr(0, 60);
}

TEST(GltfBuffers, BrokenDataUris) {
  const SceneBuilder scene = one_triangle();
  const std::string text = base64(scene.bin);
  const auto message = [&](const std::string& uri) {
    return error_of_file(scene.gltf(uri)).message();
  };
  EXPECT_NE(message("data:text/plain,abc").find("buffer 0 has 3 bytes, expected 42"),
            std::string::npos);
  EXPECT_NE(message("data:;base64").find("is a data: URI without data"), std::string::npos);
  EXPECT_NE(message("data:;base64, ?" + text.substr(1)).find("is not base64"), std::string::npos);
  EXPECT_NE(message("data:;base64, " + text + "A").find("is not base64"), std::string::npos);
  EXPECT_NE(message("data:;base64, AA==" + text).find("is not base64"), std::string::npos);
  EXPECT_NE(message("data:;base64," + text.substr(4)).find("buffer 0 has 39 bytes, expected 42"),
            std::string::npos)
      << message("data:;base64," + text.substr(4));
  EXPECT_NE(message("data:;base64,?" + text.substr(1)).find("is not base64"), std::string::npos);
}

TEST(Base64, DecodesTheExamplesOfTheRfc) {
  const std::pair<const char*, const char*> examples[] = {
      {"", ""},        {"Zg==", "f"},        {"Zm8=", "fo"},
      {"Zm9v", "foo"}, {"Zm9vYg==", "foob"}, {"Zm8", "fo"}};
  for (const auto& [text, expected] : examples) {
    const std::string characters = text;
    const auto bytes = std::as_bytes(std::span(characters));
    std::string decoded(3 * ((characters.size() + 3) / 4), '\0');
    ASSERT_TRUE(decode_base64(bytes, reinterpret_cast<std::byte*>(decoded.data())));
    decoded.resize(base64_bytes(bytes.size(), bytes.last(std::min<size_t>(2, bytes.size()))));
    EXPECT_EQ(decoded, expected);
  }
}

}  // namespace
}  // namespace voxdag::test
