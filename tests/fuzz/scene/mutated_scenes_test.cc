// Reads scenes after random changes of their bytes. Each scene is read or refused with an Error.
// Reading causes no crash, no endless loop, and no allocation that the size of the file does not
// justify. Sanitizers and the memory budget check this.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "scene/textures/texture_set.h"
#include "tests/fuzz/scene/compressed_scenes.h"
#include "tests/fuzz/scene/rich_scene.h"

namespace voxdag::test {
namespace {

// Limits the time of a test. If a scene declares more triangles, the test opens it but does not
// read its triangles. A mutation can make a scene declare a huge number of instances.
constexpr uint64_t kMaxTriangles = 200000;

// Changes the file one to eight times: changes a byte to a random byte, to a digit or to another
// byte of the file, flips a bit, or rarely truncates the file.
std::string mutate(std::string file, std::mt19937& random) {
  const size_t changes = 1 + random() % 8;
  for (size_t i = 0; i < changes && !file.empty(); ++i) {
    char& c = file[random() % file.size()];
    switch (random() % 5) {
      case 0:
        c = static_cast<char>(random());
        break;
      case 1:
        c = static_cast<char>('0' + random() % 10);
        break;
      case 2:
        c = file[random() % file.size()];
        break;
      case 3:
        c = static_cast<char>(c ^ 1 << random() % 8);
        break;
      default:
        if (random() % 20 == 0) file.resize(random() % file.size());
    }
  }
  return file;
}

// Counts the results of reading mutated files. The tests require minimum counts, because a test in
// which all files are refused immediately, or none, would check little.
struct Outcomes {
  int worked = 0;
  int refused = 0;
  int with_image = 0;
};

// Prepares the images, and reads the surfaces of all triangles and some texels. Returns the number
// of triangles with an image.
int read_surfaces(OpenScene& open) {
  NoProgress progress;
  const auto textures = TextureSet::prepare(open.files, open.source->materials(), "scratch", 1,
                                            open.budget, progress, open.cancel);
  const auto reader = textures->open(0);
  int with_image = 0;
  for (const SurfaceTriangle& surface : surfaces_of(*open.source)) {
    const uint32_t image = textures->materials().at(surface.material).image;
    if (image == Material::kNoImage) continue;
    ++with_image;
    for (uint32_t level = 0; level < reader->levels(image); ++level)
      reader->texel(image, level, reader->width(image, level) - 1,
                    reader->height(image, level) - 1);
  }
  return with_image;
}

// Reads `file`, the mutation with the number `i`, and counts the outcome. For even `i`, invalid
// triangles are skipped.
void read(const std::string& file, int i, Outcomes& outcomes) {
  try {
    OpenScene open(file, {.skip_invalid = i % 2 == 0}, uint64_t{16} << 20);
    if (open.source->declared_triangles() <= kMaxTriangles) {
      open.triangles();
      if (read_surfaces(open) > 0) ++outcomes.with_image;
    }
    ++outcomes.worked;
  } catch (const Error& e) {
    ++outcomes.refused;
    EXPECT_NE(e.message(), "");
  } catch (const std::exception& e) {
    ADD_FAILURE() << "not an Error: " << e.what();
  }
}

void run(const std::string& original, int count, uint32_t seed, Outcomes& outcomes) {
  std::mt19937 random(seed);
  for (int i = 0; i < count; ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", mutation " + std::to_string(i));
    read(mutate(original, random), i, outcomes);
  }
}

TEST(FuzzScene, MutatedGlb) {
  const std::string file = rich_scene().glb();
  ASSERT_FALSE(triangles_of_file(file).empty());
  Outcomes outcomes;
  run(file, 2000, 1, outcomes);
  EXPECT_GT(outcomes.worked, 100);
  EXPECT_GT(outcomes.refused, 100);
}

TEST(FuzzScene, MutatedGltfWithDataUri) {
  const SceneBuilder scene = rich_scene();
  const std::string file = scene.gltf("data:application/octet-stream;base64," + base64(scene.bin));
  ASSERT_FALSE(triangles_of_file(file).empty());
  Outcomes outcomes;
  run(file, 2000, 2, outcomes);
  EXPECT_GT(outcomes.worked, 100);
  EXPECT_GT(outcomes.refused, 100);
}

// Mutates a scene with materials, images and their buffers.
TEST(FuzzScene, MutatedMaterials) {
  const SceneBuilder scene = rich_painted_scene();
  OpenScene open(scene.glb());
  ASSERT_GT(read_surfaces(open), 1);
  Outcomes outcomes;
  run(scene.glb(), 1500, 4, outcomes);
  run(scene.gltf("data:application/octet-stream;base64," + base64(scene.bin)), 1500, 5, outcomes);
  EXPECT_GT(outcomes.with_image, 100);
  EXPECT_GT(outcomes.refused, 100);
}

// Changes only numbers in the JSON, so that the parser accepts most mutations and the later checks
// are reached.
void run_with_numbers(SceneBuilder scene, uint32_t seed, Outcomes& outcomes) {
  const std::vector<uint64_t> kNumbers{0,
                                       1,
                                       2,
                                       3,
                                       4,
                                       5,
                                       6,
                                       7,
                                       255,
                                       65535,
                                       1u << 31,
                                       uint64_t{1} << 32,
                                       uint64_t{1} << 40,
                                       INT64_MAX,
                                       UINT64_MAX};
  std::mt19937 random(seed);
  const std::string bin = scene.bin;
  const std::string text = scene.root.dump();
  for (int i = 0; i < 3000; ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", mutation " + std::to_string(i));
    std::string changed = text;
    for (size_t k = 0, n = 1 + random() % 2; k < n; ++k) {
      size_t at = random() % changed.size();
      while (at < changed.size() && !std::isdigit(static_cast<unsigned char>(changed[at]))) ++at;
      size_t end = at;
      while (end < changed.size() && std::isdigit(static_cast<unsigned char>(changed[end]))) ++end;
      changed.replace(at, end - at, std::to_string(kNumbers[random() % kNumbers.size()]));
    }
    changed.insert(1, R"("buffers":[{"byteLength":)" + std::to_string(bin.size()) + "}],");
    read(make_glb(changed, bin), i, outcomes);
  }
}

TEST(FuzzScene, MutatedNumbers) {
  Outcomes outcomes;
  run_with_numbers(rich_scene(), 3, outcomes);
  EXPECT_GT(outcomes.worked, 100);
  EXPECT_GT(outcomes.refused, 100);
}

TEST(FuzzScene, MutatedNumbersOfMaterials) {
  Outcomes outcomes;
  run_with_numbers(rich_painted_scene(), 6, outcomes);
  EXPECT_GT(outcomes.with_image, 100);
  EXPECT_GT(outcomes.refused, 100);
}

#if defined(VOXDAG_HAS_DRACO) && defined(VOXDAG_HAS_MESHOPT)
// Tests the decoders of compressed geometry. Each unchanged file is decoded, and so are some
// mutations.
TEST(FuzzScene, MutatedCompressedGeometry) {
  uint32_t seed = 30;
  for (const auto& [name, file] : compressed_scenes()) {
    SCOPED_TRACE(name);
    ASSERT_FALSE(triangles_of_file(file).empty());
    Outcomes outcomes;
    run(file, 150, seed++, outcomes);
    EXPECT_GT(outcomes.worked, 3);
    EXPECT_GT(outcomes.refused, 10);
  }
}
#endif

TEST(FuzzScene, MutatedSharedScenes) {
  const std::filesystem::path folder = std::filesystem::path(VOXDAG_SHARED_SCENES) / "conformance";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "the shared scenes are not there";
  uint32_t seed = 10;
  Outcomes outcomes;
  for (const char* name :
       {"c05_strip_fan.glb", "c08_sparse.glb", "c14_quantized.glb", "c15_gpu_instancing.glb",
        "c17_morph.glb", "c18_skinned.glb", "c23_base64.gltf"}) {
    SCOPED_TRACE(name);
    std::ifstream in(folder / name, std::ios::binary);
    const std::string file{std::istreambuf_iterator<char>(in), {}};
    ASSERT_FALSE(file.empty());
    run(file, 200, seed++, outcomes);
  }
  EXPECT_GT(outcomes.worked, 100);
  EXPECT_GT(outcomes.refused, 100);
}

}  // namespace
}  // namespace voxdag::test
