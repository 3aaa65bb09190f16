// Reads the textures of small glTF scenes that the tests make.
#include <gtest/gtest.h>

#include <cmath>

#include "scene/textures/texture_set.h"
#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/support/image_files.h"
#include "tests/support/modern_image_files.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

// Returns a PNG file. `pixels` is RGBA with 8 bits.
std::string png_of(uint32_t width, uint32_t height, const std::string& pixels) {
  PngFormat format;
  format.width = width;
  format.height = height;
  return png_file(format, pixels);
}
std::string noise(size_t bytes) {
  std::string all(bytes, '\0');
  uint32_t state = 1;
  for (char& c : all) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  return all;
}

struct Warnings : NoProgress {
  std::vector<std::string> all;
  void warn(std::string_view message) override { all.emplace_back(message); }
};

// Reads the scene from memory, and writes the scratch file to a disk that simulates the faults of
// `plan`.
struct ScratchFiles : MemoryFiles {
  explicit ScratchFiles(crash::FaultPlan plan) : disk(plan) {}
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override {
    if (contents.contains(path)) return MemoryFiles::open_read(path);
    return disk.open_read(path);
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return disk.create(path);
  }
  void remove(const std::string& path) override { system_files().remove(path); }
  crash::FaultyFiles disk;
};

struct Textures {
  explicit Textures(const std::string& glb, uint64_t bytes = uint64_t{64} << 20,
                    crash::FaultPlan plan = {})
      : files(plan), budget(bytes) {
    files.contents["scene"] = glb;
    MemoryBudget scene_budget(uint64_t{64} << 20);
    const auto source = open_scene(files, {"scene"}, {}, scene_budget, cancel);
    set = TextureSet::prepare(files, source->materials(),
                              temporary_parent() + "/voxdag_textures_test", 2, budget, warnings,
                              cancel);
  }
  ScratchFiles files;
  MemoryBudget budget;
  CancelToken cancel;
  Warnings warnings;
  std::unique_ptr<TextureSet> set;
};

uint64_t channel(uint64_t texel, int c) { return texel >> 16 * c & 0xffff; }

// In an image of odd width and height, every texel of every level is the mean over the texel's
// area. This holds if the texels are in memory, and if they are in pages of the scratch file.
TEST(Textures, PyramidOfOddSizes) {
  const uint32_t width = 67, height = 45;
  const std::string glb = textured(png_of(width, height, noise(4 * width * height))).glb();
  Textures whole(glb), paged(glb, 5 << 18);
  ASSERT_TRUE(whole.warnings.all.empty()) << whole.warnings.all[0];
  const auto a = whole.set->open(0), b = paged.set->open(4 * kPageBytes);
  ASSERT_EQ(a->levels(0), 7u);
  for (uint32_t level = 1; level < 7; ++level) {
    const uint32_t w = a->width(0, level), h = a->height(0, level);
    const uint32_t fw = a->width(0, level - 1), fh = a->height(0, level - 1);
    for (uint32_t y = 0; y < h; ++y)
      for (uint32_t x = 0; x < w; ++x)
        for (int c = 0; c < 4; ++c) {
          double sum = 0;
          for (uint32_t j = 0; j < fh; ++j)
            for (uint32_t i = 0; i < fw; ++i) {
              const auto overlap = [](uint32_t coarse, uint32_t n, uint32_t fine, uint32_t m) {
                const double low = std::max<double>(coarse * m, fine * n);
                const double high = std::min<double>((coarse + 1) * m, (fine + 1) * n);
                return std::max(0.0, high - low) / m;
              };
              const double weight = overlap(x, w, i, fw) * overlap(y, h, j, fh);
              if (weight > 0)
                sum += weight * static_cast<double>(channel(a->texel(0, level - 1, i, j), c));
            }
          EXPECT_NEAR(static_cast<double>(channel(a->texel(0, level, x, y), c)), sum, 0.501);
        }
  }
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) ASSERT_EQ(a->texel(0, 0, x, y), b->texel(0, 0, x, y));
}

// Reading a damaged page of the scratch file is an error; it never gives a wrong color.
TEST(Textures, DamagedPages) {
  const uint32_t width = 300, height = 200;
  const std::string glb = textured(png_of(width, height, noise(4 * width * height))).glb();
  // Calls use(texel) for all texels of all levels.
  const auto read_all = [](Textures& textures, const auto& use) {
    ASSERT_FALSE(textures.set->is_in_memory());
    const auto reader = textures.set->open(4 * kPageBytes);
    for (uint32_t level = 0; level < reader->levels(0); ++level)
      for (uint32_t y = 0; y < reader->height(0, level); ++y)
        for (uint32_t x = 0; x < reader->width(0, level); ++x) use(reader->texel(0, level, x, y));
  };
  Textures sound(glb, 5 << 18);
  uint64_t texels = 0;
  read_all(sound, [&](uint64_t) { ++texels; });
  EXPECT_GT(texels, width * height);
  // The first operation makes the file. Each further operation writes a row of tiles (blocks of
  // texels, one page each).
  const uint64_t operations = sound.files.disk.operations();
  EXPECT_GT(operations, 15u);
  for (uint64_t at = 2; at <= operations; ++at) {
    Textures damaged(glb, 5 << 18, {crash::Fault::kFlipBit, at});
    const Error error = error_of([&] { read_all(damaged, [](uint64_t) {}); });
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << at;
    EXPECT_NE(error.message().find("fails its checksum"), std::string::npos) << error.message();
  }
}

// sRGB channels are converted to linear light. Alpha is already linear.
TEST(Textures, LinearLight) {
  Textures t(textured(png_of(2, 1, std::string("\x00\xff\xbc\x80\x0a\x80\x01\xff", 8))).glb());
  const auto reader = t.set->open(0);
  for (const auto& [x, c, value] : {std::array{0, 1, 255}, {0, 2, 188}, {1, 0, 10}, {1, 1, 128}}) {
    const double v = value / 255.0;
    const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    EXPECT_EQ(channel(reader->texel(0, 0, static_cast<uint32_t>(x), 0), c),
              static_cast<uint64_t>(std::lround(linear * 65535)));
  }
  EXPECT_EQ(channel(reader->texel(0, 0, 0, 0), 3), 128u * 257);
}

// Reads an image from a view of a buffer that is a data: URI, even if JSON escapes the URI's
// slashes, and whatever the buffer's first bytes are. With the first byte 't', the base64 text
// begins with "dA", like the scheme "data:" in other case.
TEST(Textures, InBase64Buffers) {
  SceneBuilder scene = textured("");
  const std::string png = png_of(1, 1, "\xff\xff\xff\x80");
  scene.root["images"] = {
      {{"bufferView", scene.add_view(std::vector<uint8_t>(png.begin(), png.end()))}}};
  for (const char first : {'\0', 't'}) {
    scene.bin[0] = first;
    const std::string gltf =
        scene.gltf("data:application/octet-stream;base64," + base64(scene.bin));
    std::string escaped = gltf;
    escaped.replace(gltf.find("/octet"), 1, "\\/");
    for (const std::string& text : {gltf, escaped}) {
      Textures t(text);
      ASSERT_TRUE(t.warnings.all.empty()) << t.warnings.all[0];
      EXPECT_EQ(t.set->open(0)->texel(0, 0, 0, 0), 0x8080ffffffffffffu);
    }
  }
}

// Reads images in data: URIs in forms that RFC 2397 does not allow.
TEST(Textures, InDataUrisOfOtherPrograms) {
  const std::string png = png_of(5, 5, noise(4 * 25)), text = base64(png);
  std::string lines, url_safe, percent, bytes;
  for (size_t i = 0; i < text.size(); ++i) {
    lines += (i % 20 == 19 ? "\r\n" : "") + text.substr(i, 1);
    url_safe += text[i] == '+' ? '-' : text[i] == '/' ? '_' : text[i];
    percent += text[i] == '+' ? "%2B" : text[i] == '/' ? "%2f" : text.substr(i, 1);
  }
  ASSERT_NE(url_safe, text);
  for (const char byte : png) {
    const auto value = static_cast<unsigned char>(byte);
    // Printable characters stand for themselves, except the percent sign. Other bytes are
    // percent-encoded.
    if (value > ' ' && value < 127 && value != '%')
      bytes += byte;
    else
      bytes += {'%', "0123456789abcdef"[value / 16], "0123456789ABCDEF"[value % 16]};
  }
  Textures plain(textured(png).glb());
  for (const std::string& uri :
       {"data:image/png;base64,\n" + lines + "\n", "data:image/png;base64, " + url_safe,
        "data:image/png;base64," + percent, "DATA:image/png; Base64," + text,
        "data:image/png," + bytes}) {
    SceneBuilder scene = textured("");
    scene.root["images"][0]["uri"] = uri;
    Textures t(scene.glb());
    ASSERT_TRUE(t.warnings.all.empty()) << t.warnings.all[0];
    for (int x = 0; x < 5; ++x)
      EXPECT_EQ(t.set->open(0)->texel(0, 0, x, 2), plain.set->open(0)->texel(0, 0, x, 2));
  }
}

// An image that cannot be read causes a warning that names the image and a material. Other images
// are not affected.
TEST(Textures, BrokenImages) {
  const std::string good = png_of(9, 9, noise(4 * 81));
  std::string huge = good, flipped = good;
  huge.replace(16, 4, big_endian(1u << 31));
  flipped[60] = static_cast<char>(flipped[60] ^ 1);
  for (const std::string& image :
       {huge, flipped, good.substr(0, good.size() / 2), std::string("RIFF....WEBP"),
        std::string("\xabKTX 20\xbb\r\n\x1a\n"), std::string("DDS 1234"),
        std::string("\xff\xd8\xff\xe0"), std::string()}) {
    Textures t(textured(image).glb());
    ASSERT_EQ(t.warnings.all.size(), 1u);
    EXPECT_NE(t.warnings.all[0].find("image 0 \"wood\""), std::string::npos);
    EXPECT_NE(t.warnings.all[0].find("material 0 \"floor\""), std::string::npos);
    EXPECT_EQ(t.set->materials()[0].image, Material::kNoImage);
  }
}

// One warning counts the images and materials that have the same problem.
TEST(Textures, MaterialsWithUnreadableImages) {
  SceneBuilder scene = textured("\xabKTX 20\xbb\r\n\x1a\n");
  scene.root["images"].push_back(scene.root["images"][0]);
  scene.root["textures"].push_back({{"source", 1}});
  for (const int texture : {0, 1})
    scene.root["materials"].push_back(
        {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  Textures t(scene.glb());
  ASSERT_EQ(t.warnings.all.size(), 1u);
  for (const char* part : {"image 0 \"wood\"", "material 0 \"floor\"", "a KTX2 image",
                           "gltf-transform ktxdecompress", "of 3 materials", "(2 times)"})
    EXPECT_NE(t.warnings.all[0].find(part), std::string::npos) << t.warnings.all[0];
}

#ifdef VOXDAG_HAS_WEBP
TEST(Textures, WebpImages) {
  const std::string pixels = noise(4 * 9 * 7);
  Textures webp(textured(webp_file(9, 7, pixels)).glb()), png(textured(png_of(9, 7, pixels)).glb());
  ASSERT_TRUE(webp.warnings.all.empty()) << webp.warnings.all[0];
  const auto a = webp.set->open(0), b = png.set->open(0);
  for (uint32_t y = 0; y < 7; ++y)
    for (uint32_t x = 0; x < 9; ++x) ASSERT_EQ(a->texel(0, 0, x, y), b->texel(0, 0, x, y));
}
#endif

#ifdef VOXDAG_HAS_AVIF
TEST(Textures, AvifImages) {
  const std::string pixels = noise(4 * 9 * 7);
  Textures avif(textured(avif_file({.width = 9, .height = 7}, pixels)).glb()),
      png(textured(png_of(9, 7, pixels)).glb());
  ASSERT_TRUE(avif.warnings.all.empty()) << avif.warnings.all[0];
  const auto a = avif.set->open(0), b = png.set->open(0);
  for (uint32_t y = 0; y < 7; ++y)
    for (uint32_t x = 0; x < 9; ++x) ASSERT_EQ(a->texel(0, 0, x, y), b->texel(0, 0, x, y));
}
#endif

}  // namespace
}  // namespace voxdag::test
