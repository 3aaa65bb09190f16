// Digests of files with colors. Every version, compiler and distribution must make these bytes
// from the same scene, including its images. If a digest changes, the format needs a new
// version.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "scheduler/run_build.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/stages/attributes/painted_scene.h"

namespace voxdag {
namespace {

// Returns the digest of a build of the painted scene. If `image` is not empty, this image of
// tests/golden replaces the scene's image.
std::string digest_of(const std::string& image, uint64_t color_resolution) {
  TemporaryFolder folder;
  BuildSpec spec;
  spec.geometry.scenes = {PaintedScene::write(folder.path())};
  if (!image.empty())
    std::filesystem::copy_file(VOXDAG_SOURCE_DIR "/tests/golden/" + image,
                               folder.path() + "/halves.png",
                               std::filesystem::copy_options::overwrite_existing);
  spec.geometry.resolution = 128;
  spec.geometry.attributes.add(Attribute::kColor);
  spec.geometry.color_resolution = color_resolution;
  spec.run.output = folder.path() + "/out.vdag";
  spec.run.memory_bytes = uint64_t{128} << 20;
  spec.run.threads = 2;
  return build_now(spec).sha256;
}

TEST(GoldenColors, Png) {
  EXPECT_EQ(digest_of("", 128), "a7e8a2694b4630e056de778ee92493485349979f999fee85aa979b7274fc089d");
  EXPECT_EQ(digest_of("", 16), "c5edeb1ed8c25e73db763d62cb6908aa5559b2169b549c9ed96fc52b5a032f6f");
}

// The two JPEG files encode the same samples, one as a baseline image and one as a progressive
// image. So they give the same file.
TEST(GoldenColors, Jpeg) {
  const char* const expected = "37b0b86705169ef42183e369c19154ed5af1e19cf4a098456979f4e274d81030";
  EXPECT_EQ(digest_of("waves.jpg", 128), expected);
  EXPECT_EQ(digest_of("waves_progressive.jpg", 128), expected);
}

}  // namespace
}  // namespace voxdag
