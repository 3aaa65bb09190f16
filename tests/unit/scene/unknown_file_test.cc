// Files that are not scenes are refused with an error that names their format.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/audience_guard.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag {
namespace {

using test::error_of_file;
using test::OpenScene;
using test::triangles_of;
using testing::AllOf;
using testing::HasSubstr;

// Returns a text whose characters have `bytes` bytes; byte `at` is the ASCII character.
std::string wide(std::string_view text, size_t bytes, size_t at) {
  std::string all(text.size() * bytes, '\0');
  for (size_t i = 0; i < text.size(); ++i) all[i * bytes + at] = text[i];
  return all;
}

// Returns the header of a tar file without magic number, as before POSIX.
std::string old_tar(std::string name) {
  name.resize(512, '\0');
  name.replace(148, 8, 8, ' ');
  unsigned sum = 0;
  for (const char c : name) sum += static_cast<unsigned char>(c);
  std::string digits;
  for (int i = 0; i < 6; ++i, sum /= 8) digits.insert(0, 1, static_cast<char>('0' + sum % 8));
  return name.replace(148, 7, digits + '\0');
}

TEST(UnknownFile, IsNamedByItsFirstBytes) {
  const std::pair<std::string, const char*> cases[] = {
      {"\x1f\x8b\x08\x00 compressed", "is compressed by gzip: unpack it first"},
      {std::string("\xfd\x37zXZ\0 data", 11), "is compressed by xz"},
      {"version https://git-lfs.github.com/spec/v1\noid sha256:0", "run git lfs pull"},
      {"PK\x03\x04 anything", "is a zip archive, as 3MF, USDZ and KMZ files are"},
      {"Kaydara FBX Binary  \x1a", "is an FBX file"},
      {"; FBX 7.3.0 project file\n", "is an FBX file"},
      {std::string("MM\x10\0\0\0", 6), "is a 3DS file"},
      {std::string("MM\0*\0\0", 6), "is a TIFF image"},
      {std::string(257, ' ') + "ustar", "is a tar archive"},
      {"OFF\n8 6 0\n", "is an OFF file"},
      {"# .PCD v0.7\n", "is a PCD point cloud: convert it to PLY"},
      {"<?xml version=\"1.0\"?>\n<COLLADA version=\"1.4.1\">", "is a COLLADA file"},
      {"\n <!DOCTYPE html><title>404</title>", "is a web page, perhaps the error page"},
      {"<svg/>", "is an SVG drawing"},
      {"\x89PNG\r\n\x1a\n", "is a PNG image"},
      {"\xabKTX 20\xbb\r\n", "is a KTX2 image"},
      {"8BPS", "is a Photoshop image"},
      {"RIFF....WEBPVP8L", "is a WebP image"},
      {"", "is empty; expected a scene"},
      {" \n\n", "begins with blanks only"},
      {std::string("\xff\xfev\0 \0", 6),
       "is text in UTF-16LE: convert it first: iconv -f UTF-16LE"},
      {std::string("\xfe\xff\0v\0 ", 6), "is text in UTF-16BE: convert it first"},
      {std::string("\xff\xfe\0\0v\0\0\0", 8), "is text in UTF-32LE: convert it first"},
      {std::string("\0\0\xfe\xff\0\0\0v", 8), "is text in UTF-32BE: convert it first"},
      {wide("v 0 0 0\n", 2, 0), "is text in UTF-16LE: convert it first"},
      {wide("v 0 0 0\n", 2, 1), "is text in UTF-16BE: convert it first"},
      {wide("ply\r\n", 4, 0), "is text in UTF-32LE: convert it first"},
      {wide("{\"a\":1}", 4, 3), "is text in UTF-32BE: convert it first"},
      {"\x1f\x9d\x90\x76", "is compressed by compress: unpack it first"},
      {std::string("]\0\0\x80\0\xff", 6), "is compressed by lzma: unpack it first"},
      {"LZIP\x01", "is compressed by lzip"},
      {old_tar("model.obj"), "is a tar archive: unpack it first"},
      {"ASTM-E57\x01", "is an E57 point cloud: convert it to PLY or LAS"},
      {"3\n0 0 0 9 255 0 0\n1 0 0 9 0 0 0\n",
       "is a PTS point cloud: remove its first line, and name the rest .xyz; --columns "
       "x,y,z,_,r,g,b reads its colors"},
      {"2\r\n2\r\n0 0 0\r\n1 0 0\r\n", "is a PTX point cloud: convert it to LAS or PLY"},
      {"// made by hand\n{\"asset\": 1}", "is JSON with comments, which glTF does not allow"},
      {"/* a */ // b\r\n\n{}", "is JSON with comments, which glTF does not allow"},
      {"caf\xe9 caf\xc3\xa9", "it begins with caf? caf\xc3\xa9"},
      {"hello\x1b[2J", "has an unknown format; it begins with hello?[2J"},
  };
  for (const auto& [bytes, message] : cases) {
    const Error error = error_of_file(bytes);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_THAT(error.message(), AllOf(HasSubstr(message), HasSubstr("glTF (.glb, .gltf); PLY")));
  }
}

Error error_of_text(const std::string& file) {
  OpenScene open("0 0 0\n");
  open.files.contents["a.csv"] = file;
  try {
    triangles_of(*open_scene(open.files, {"a.csv"}, {}, open.budget, open.cancel));
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorCode::kInvalidInput, "");
}

// The error also names another text format if the file's name has an ending of text points.
TEST(UnknownFile, OtherTextsAreNotPoints) {
  EXPECT_THAT(error_of_text("version https://git-lfs.github.com/spec/v1\noid sha256:0").message(),
              HasSubstr("a.csv: is a Git LFS pointer, not the file itself: run git lfs pull"));
  EXPECT_THAT(error_of_text("<!DOCTYPE html><title>404</title>").message(),
              HasSubstr("is a web page"));
  EXPECT_THAT(error_of_text("OFF\n8 6 0\n").message(), HasSubstr("is an OFF file"));
  EXPECT_THAT(error_of_text("# .PCD v.7\nVERSION .7\n").message(), HasSubstr("is a PCD point"));
  EXPECT_THAT(error_of_text("2\n0 0 0 9 255 0 0\n1 0 0 9 0 0 0\n").message(),
              HasSubstr("is a PTS point cloud"));
  EXPECT_THAT(error_of_text("2\n2\n0 0 0\n1 0 0\n").message(), HasSubstr("is a PTX point cloud"));
  EXPECT_EQ(error_of_text("OFFSET,x,y,z\n9,1,2,3\n").message(), "");
  EXPECT_EQ(error_of_text("MM,x,y,z\n9,1,2,3\n").message(), "");
}

#ifdef VOXDAG_HAS_ASSIMP
TEST(UnknownFile, OnlyUsersOfTheProgramCanImport) {
  const auto message = [](const Audience& audience) {
    const test::AudienceGuard guard(audience);
    return error_of_text("OFF\n8 6 0\n").message();
  };
  EXPECT_THAT(message(kCommandLineUsers), HasSubstr("convert it first: voxdag import IN OUT.glb"));
  EXPECT_THAT(message(kPythonUsers), HasSubstr("the shell command voxdag import IN OUT.glb"));
  EXPECT_THAT(message(test::kOtherUsers), HasSubstr("for example with Blender"));
}
#endif

// A file is read as glTF if it begins with the signature of a GLB or with JSON. White space or a
// byte order mark can precede the JSON.
TEST(UnknownFile, JsonIsGltf) {
  for (const char* text : {"{", "[", "\n\t {", "\xef\xbb\xbf{", "glTF"})
    EXPECT_THAT(error_of_file(text).message(), testing::Not(HasSubstr("expected a scene")));
  const std::string text = R"({"asset":{"version":"2.0"}})";
  EXPECT_EQ(error_of_file(text + "\n\x1a").message(), "");
}

}  // namespace
}  // namespace voxdag
