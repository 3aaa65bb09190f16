#include "query/render/picture.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/base/error.h"
#include "core/io/file_system.h"
#include "query/render/renderer.h"
#include "tests/unit/query/voxel_scene.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

uint32_t big_endian(const std::string& bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

Picture render(const VoxelScene& scene, const Placement& placement, unsigned threads,
               Background background = Background::kSky) {
  RenderOptions options;
  options.background = background;
  options.width = 64;
  options.height = 48;
  options.threads = threads;
  NoProgress progress;
  const CancelToken cancel;
  const DagView dag = scene.view();
  return render_picture(dag, placement, options, progress, cancel);
}

// A PNG file has its signature, an IHDR chunk with the size and format (8 bits, RGB), and IEND at
// its end.
TEST(Picture, IsAPngOfItsSize) {
  Picture picture(123, 45);
  picture.pixel(7, 9)[1] = 200;
  const std::string png = encode_png(picture);
  ASSERT_GT(png.size(), 57u);
  EXPECT_EQ(png.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(big_endian(png, 8), 13u);
  EXPECT_EQ(png.substr(12, 4), "IHDR");
  EXPECT_EQ(big_endian(png, 16), 123u);
  EXPECT_EQ(big_endian(png, 20), 45u);
  EXPECT_EQ(png[24], 8);
  EXPECT_EQ(png[25], 2);
  EXPECT_EQ(png.substr(png.size() - 8, 4), "IEND");
}

TEST(Picture, IsAJpegByItsName) {
  const Picture picture(20, 10);
  EXPECT_EQ(encode_picture(picture, "p.png"), encode_png(picture));
  EXPECT_EQ(encode_picture(picture, "jpg"), encode_png(picture));
  for (const char* name : {"p.jpg", "P.JpEg"}) {
    const std::string jpeg = encode_picture(picture, name);
    EXPECT_EQ(jpeg.substr(0, 2), "\xff\xd8") << name;
    EXPECT_EQ(jpeg.substr(20, 10), std::string("\xff\xfe\0\x08voxdag", 10)) << name;
    EXPECT_EQ(jpeg.substr(jpeg.size() - 2), "\xff\xd9") << name;
  }
  EXPECT_THROW(encode_picture(Picture(20, 10, 4), "p.jpg"), Error);
}

TEST(Picture, IsWrittenWhole) {
  const auto folder = std::filesystem::temp_directory_path() / "voxdag_picture_test";
  std::filesystem::create_directories(folder);
  const std::string path = folder / "p.png";
  const Picture picture(20, 10);
  voxdag::write_file_atomically(system_files(), path, encode_png(picture));
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(bytes, encode_png(picture));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
  std::filesystem::remove_all(folder);
}

// The pixels are the same for any number of threads.
TEST(Renderer, ThreadsDoNotChangeThePicture) {
  EXPECT_EQ(render(VoxelScene::block(), kFromTheFront, 1).bytes,
            render(VoxelScene::block(), kFromTheFront, 3).bytes);
}

// The block is in the center of the picture, in front of the background, and lit.
TEST(Renderer, ShowsTheBlockInTheMiddle) {
  const VoxelScene nothing(4, {});
  Picture with = render(VoxelScene::block(), kFromTheFront, 2),
          without = render(nothing, kFromTheFront, 2);
  const auto differs = [&](int x, int y) {
    int sum = 0;
    for (int c = 0; c < 3; ++c) sum += std::abs(with.pixel(x, y)[c] - without.pixel(x, y)[c]);
    return sum > 24;
  };
  EXPECT_TRUE(differs(32, 24));
  EXPECT_FALSE(differs(1, 1));
  EXPECT_FALSE(differs(62, 1));
  int pixels = 0;
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 64; ++x) pixels += differs(x, y);
  // The block is about 19 pixels wide: its edge is 4 voxels, and its distance 14 voxels.
  EXPECT_GT(pixels, 150);
  EXPECT_LT(pixels, 700);
  // The block is neither black nor overexposed.
  EXPECT_GT(with.pixel(32, 24)[0], 60);
  EXPECT_LT(with.pixel(32, 24)[0], 250);
}

TEST(Renderer, ATransparentBackgroundHasAlpha) {
  Picture picture = render(VoxelScene::block(), kFromTheFront, 2, Background::kTransparent);
  ASSERT_EQ(picture.channels, 4);
  EXPECT_EQ(encode_png(picture)[25], 6) << "expected RGBA";
  EXPECT_EQ(picture.pixel(32, 24)[3], 255);
  for (int c = 0; c < 4; ++c) EXPECT_EQ(picture.pixel(1, 1)[c], 0);
  // A transparent background has no floor and no shadow: only pixels of the block are visible.
  int visible = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) visible += picture.pixel(x, y)[3] > 0;
  EXPECT_LT(visible, 700);
}

TEST(Renderer, AWhiteBackgroundIsWhite) {
  Picture picture = render(VoxelScene::block(), kFromTheFront, 2, Background::kWhite);
  ASSERT_EQ(picture.channels, 3);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(picture.pixel(1, 1)[c], 255);
  EXPECT_LT(picture.pixel(32, 24)[0], 250);
}

TEST(Renderer, StopsWhenCanceled) {
  const VoxelScene scene = VoxelScene::block();
  const DagView dag = scene.view();
  NoProgress progress;
  CancelToken cancel;
  cancel.cancel();
  EXPECT_THROW(render_picture(dag, kFromTheFront, {}, progress, cancel), Error);
}

// An error on any thread stops the other threads, and is thrown to the caller.
TEST(Renderer, ReportsDamage) {
  VoxelScene scene = VoxelScene::block();
  scene.level_words(1).at(1) = 0x7fffffff;
  const DagView dag = scene.view();
  NoProgress progress;
  const CancelToken cancel;
  RenderOptions options;
  options.threads = 3;
  EXPECT_THROW(render_picture(dag, kFromTheFront, options, progress, cancel), Error);
}

}  // namespace
