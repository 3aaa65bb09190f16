// Imports scenes of other formats, and reads the written files.
#include "scene/import/import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>

#include "core/base/process_limits.h"
#include "core/image/png_writer.h"
#include "scene/import/confined_process.h"
#include "scene/textures/linear_light.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scene/import/scene_texts.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr uint64_t kMemory = uint64_t{256} << 20;

class Import : public testing::Test {
 protected:
  void put(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_.path() + "/" + name, std::ios::binary) << bytes;
  }
  ImportReport import(const std::string& name, const std::string& bytes,
                      uint64_t memory = kMemory) {
    put(name, bytes);
    warnings_.clear();
    return import_scene(
        system_files(), folder_.path() + "/" + name, glb_, memory,
        [&](const Warning& warning) { warnings_.push_back(warning.code); }, progress_, cancel_);
  }
  std::unique_ptr<TriangleSource> open() {
    return open_scene(system_files(), {glb_}, {}, budget_, cancel_);
  }
  std::vector<Corners> triangles() { return triangles_of(*open()); }
  // Returns the material of the first triangle.
  Material material() {
    const auto scene = open();
    return scene->materials().materials.at(surfaces_of(*scene).at(0).material);
  }
  // Imports a file that must be refused. Returns the error, after checking that nothing remains.
  Error refuse(const std::string& name, const std::string& bytes, uint64_t memory = kMemory) {
    try {
      import(name, bytes, memory);
    } catch (const Error& error) {
      EXPECT_FALSE(system_files().exists(glb_));
      EXPECT_FALSE(system_files().exists(glb_ + ".partial"));
      return error;
    }
    ADD_FAILURE() << "imported";
    return Error(ErrorCode::kInvalidInput, "");
  }

  TemporaryFolder folder_;
  const std::string glb_ = folder_.path() + "/out.glb";
  std::vector<std::string> warnings_;
  NoProgress progress_;
  CancelToken cancel_;
  MemoryBudget budget_{uint64_t{64} << 20};
};

TEST_F(Import, Off) {
  const ImportReport report = import("a.off", kOff);
  EXPECT_EQ(report.triangles, 3u);
  EXPECT_EQ(report.meshes, 1u);
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_TRUE(is_imported_scene(*system_files().open_read(glb_)));
  // The concave face is divided at its inner corner, as in a PLY file, so both of its triangles
  // have this corner.
  const std::array<double, 3> inner{1, 1, 0};
  const auto all = triangles();
  ASSERT_EQ(all.size(), 3u);
  for (size_t i = 0; i < 2; ++i) EXPECT_EQ(std::ranges::count(all[i], inner), 1);
  EXPECT_EQ(all[2], (Corners{{{0, 0, 0}, {4, 1, 0}, {4, 4, 9}}}));
}

TEST_F(Import, TransformsOfNodes) {
  const ImportReport report = import("a.dae", collada("<color>1 0 0 1</color>"));
  EXPECT_EQ(report.triangles, 1u);
  EXPECT_THAT(triangles(), UnorderedElementsAre(Corners{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}},
                                                Corners{{{0, 20, 0}, {2, 20, 0}, {0, 22, 0}}}));
}

TEST_F(Import, MaterialsAndImageFiles) {
  import("a.dae", collada("<color>1 0.5 0 1</color>"));
  EXPECT_EQ(material().name, "paint");
  EXPECT_EQ(material().factor, (std::array<uint16_t, 4>{65535, linear_light(0.5), 0, 65535}));

  const std::string images =
      R"(<library_images><image id="image"><init_from>textures\my%20wood.png)"
      "</init_from></image></library_images>";
  const std::string textured = collada(R"(<texture texture="sampler" texcoord="UVSET0"/>)", images);
  import("b.dae", textured);
  EXPECT_THAT(warnings_, ElementsAre("unusable-image"));

  put("my wood.png", encode_png(1, 1, std::array<uint8_t, 3>{255, 0, 0}));
  EXPECT_EQ(import("b.dae", textured).images, 1u);
  EXPECT_THAT(warnings_, IsEmpty());
  const auto scene = open();
  const SceneMaterials materials = scene->materials();
  EXPECT_EQ(material().factor, (std::array<uint16_t, 4>{65535, 65535, 65535, 65535}));
  EXPECT_EQ(material().image, 0u);
  ASSERT_EQ(materials.images.size(), 1u);
  EXPECT_EQ(materials.images[0].problem, "");
  const auto all = surfaces_of(*scene);
  ASSERT_EQ(all.size(), 2u);
  constexpr int64_t kOne = int64_t{1} << kTextureBits;
  EXPECT_EQ(all[0].corners[0].texture, (std::array<int64_t, 2>{0, kOne}));
  EXPECT_EQ(all[0].corners[2].texture, (std::array<int64_t, 2>{0, kOne / 4 * 3}));

  put("my wood.png", "BM and so on");
  import("b.dae", textured);
  EXPECT_THAT(warnings_, ElementsAre("unusable-image"));
}

TEST_F(Import, Binary3ds) {
  import("a.3ds", max_3ds());
  EXPECT_EQ(material().factor, (std::array<uint16_t, 4>{65535, 0, 0, 65535}));
  EXPECT_EQ(material().name, "red");
  // The z axis points upward in 3DS files, and the y axis in glTF. So (x y z) becomes (x z -y).
  EXPECT_EQ(triangles(), std::vector<Corners>({{{{0, 0, 0}, {1, 0, 0}, {0, 0, -1}}}}));
}

TEST_F(Import, Archive3mf) {
  refuse("cut.3mf", three_mf().substr(0, 300));
  import("a.3mf", three_mf());
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_EQ(material().factor, (std::array<uint16_t, 4>{65535, 0, 0, 65535}));
  EXPECT_EQ(triangles(), std::vector<Corners>({{{{10, 0, 0}, {14, 1, 0}, {10, 2, 0}}},
                                               {{{10, 0, 0}, {14, 1, 0}, {11, 1, 3}}}}));
}

// The unit becomes the meter, and y becomes the upward axis.
TEST_F(Import, UnitAndAxesOfFbx) {
  import("a.fbx", kFbx);
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_EQ(material().factor, (std::array<uint16_t, 4>{0, 65535, 0, 65535}));
  const std::array<double, 3> inner{5.5, 0, -0.5};
  const auto all = triangles();
  ASSERT_EQ(all.size(), 2u);
  for (const Corners& corners : all) EXPECT_EQ(std::ranges::count(corners, inner), 1);
}

// assimp reads two meshes of this file, but only one node. The mesh without a node causes a
// warning.
TEST_F(Import, MeshesWithoutNodesAreWarnings) {
  import("a.raw",
         "a\n0.5 0.5 0.5 0 0 0 0 1 0 1 0 0\nb\n0.1 0 0 0 0 3 0 1 3 1 0 3\n"
         "0.5 0.5 0.5 0 0 6 0 1 6 1 0 6\n");
  EXPECT_THAT(warnings_, ElementsAre("unused-mesh"));
  EXPECT_FALSE(triangles().empty());
}

TEST_F(Import, LossesAreWarnings) {
  const std::string extra =
      R"(<library_cameras><camera id="c"><optics><technique_common><perspective><xfov>45</xfov>
      </perspective></technique_common></optics></camera></library_cameras>)";
  std::string file = collada("<color>1 0 0 1</color>", extra);
  file.insert(file.find("<node name=\"inner\">"),
              "<node name=\"eye\"><instance_camera url=\"#c\"/></node>");
  import("a.dae", file);
  EXPECT_THAT(warnings_, ElementsAre("ignored-cameras-and-lights"));
}

TEST_F(Import, FaultsLeaveNothingBehind) {
  EXPECT_THAT(refuse("a.xyzzy", "hello").message(), HasSubstr("cannot be imported, expected one"));
  EXPECT_THAT(refuse("a.dae", "<COLLADA").message(), HasSubstr("a.dae: cannot be imported: "));
  EXPECT_THAT(refuse("b.off", "OFF\n2 1 0\n0 0 0\n1 0 0\n2 0 1\n").message(),
              HasSubstr("no triangles"));
  try {
    import_scene(system_files(), folder_.path() + "/none.off", glb_, kMemory, {}, progress_,
                 cancel_);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kNotFound);
  }
  cancel_.cancel();
  EXPECT_EQ(refuse("a.off", kOff).code(), ErrorCode::kCanceled);
}

TEST_F(Import, WarningsCanEndTheImport) {
  put("a.dae", collada(R"(<texture texture="sampler" texcoord="UVSET0"/>)",
                       R"(<library_images><image id="image"><init_from>none.png</init_from>
                       </image></library_images>)"));
  const auto strict = [](const Warning& warning) {
    throw Error(ErrorCode::kInvalidInput, warning.text());
  };
  EXPECT_THROW(import_scene(system_files(), folder_.path() + "/a.dae", glb_, kMemory, strict,
                            progress_, cancel_),
               Error);
  EXPECT_FALSE(system_files().exists(glb_));
  EXPECT_FALSE(system_files().exists(glb_ + ".partial"));
}

#if !VOXDAG_SANITIZED
TEST_F(Import, MemoryIsLimited) {
  std::string file = "OFF\n3 300000 0\n0 0 0\n1 0 0\n0 1 0\n";
  for (int i = 0; i < 300000; ++i) file += "3 0 1 2\n";
  const Error error = refuse("a.off", file, uint64_t{8} << 20);
  EXPECT_EQ(error.code(), ErrorCode::kOutOfMemory);
  EXPECT_THAT(error.message(), HasSubstr("a higher --memory"));
  EXPECT_EQ(import("a.off", file).triangles, 300000u);
}
#endif

// --- The child process ------------------------------------------------------------------------

Error error_of(const std::function<void(const SendMessage&)>& work) {
  const CancelToken cancel;
  try {
    run_confined(
        "x", kMemory, work, [](const Json&) {}, cancel);
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorCode::kInvalidInput, "");
}

TEST(ConfinedProcess, PassesMessages) {
  std::vector<int> numbers;
  const CancelToken cancel;
  run_confined(
      "x", kMemory,
      [](const SendMessage& send) {
        for (int i = 0; i < 10000; ++i) send({{"number", i}});
      },
      [&](const Json& message) { numbers.push_back(message["number"]); }, cancel);
  ASSERT_EQ(numbers.size(), 10000u);
  EXPECT_EQ(numbers[9999], 9999);
}

TEST(ConfinedProcess, FailuresAreErrors) {
  const Error thrown = error_of([](const SendMessage&) { throw Error(ErrorCode::kLimit, "no\n"); });
  EXPECT_EQ(thrown.code(), ErrorCode::kLimit);
  EXPECT_EQ(thrown.message(), "no\n");
  const Error crash = error_of([](const SendMessage&) {
    std::signal(SIGSEGV, SIG_DFL);
    std::raise(SIGSEGV);
  });
  EXPECT_EQ(crash.code(), ErrorCode::kInvalidInput);
  EXPECT_THAT(crash.message(),
              HasSubstr("x: the process that converts the file crashed (Segmentation fault)"));
  EXPECT_EQ(error_of([](const SendMessage&) { std::raise(SIGKILL); }).code(),
            ErrorCode::kOutOfMemory);
  EXPECT_EQ(error_of([](const SendMessage&) { throw std::bad_alloc(); }).code(),
            ErrorCode::kOutOfMemory);
}

}  // namespace
}  // namespace voxdag::test
