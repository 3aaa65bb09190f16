// The tests store the triangles of a glTF scene in other formats. The build gives the same bytes,
// even if it is killed during ingest and then resumed.
#include <cstring>
#include <iomanip>
#include <sstream>

#include "scene/formats/formats.h"
#include "tests/crash/crash_fixture.h"

#ifdef VOXDAG_HAS_MESHOPT
#include <meshoptimizer.h>
#endif

namespace crash {
namespace {

template <class T>
void append(std::string& bytes, T value) {
  char own[sizeof(T)];
  std::memcpy(own, &value, sizeof(T));
  bytes.append(own, sizeof(T));
}

// `expected_` is the digest of a build of scene.glb. The tests build other files with the same
// triangles.
class FormatTest : public CrashTest {
 protected:
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    if (!path_.empty()) spec.geometry.scenes = {path_};
    return spec;
  }

  // Returns the corners of all triangles of scene.glb, three coordinates for each corner.
  std::vector<double> corners() const {
    voxdag::MemoryBudget budget(uint64_t{1} << 28);
    const voxdag::CancelToken cancel;
    const auto scene =
        voxdag::open_scene(voxdag::system_files(), {folder_.file("scene.glb")}, {}, budget, cancel);
    std::vector<double> all;
    scene->for_each_batch([&](auto batch) {
      for (const auto& triangle : batch)
        for (const auto& corner : triangle.v) all.insert(all.end(), corner, corner + 3);
    });
    return all;
  }

  void expect_the_same_bytes(const char* name, const std::string& bytes) {
    const std::string path = folder_.file(name);
    const auto file = voxdag::system_files().create(path);
    file->write_at(0, std::as_bytes(std::span(bytes)));
    file->close();
    path_ = path;
    const uint64_t operations = operations_of_a_build();
    expect_to_resume();
    uint64_t kills = 0;
    for (const uint64_t at : moments(operations)) {
      SCOPED_TRACE(testing::Message() << "at operation " << at << " of " << operations);
      kills += killed({Fault::kKillAfter, at});
      expect_to_resume();
    }
    EXPECT_GT(kills, 0u);
  }

 private:
  std::string path_;
};

TEST_P(FormatTest, Ply) {
  const std::vector<double> all = corners();
  const std::string triangles = std::to_string(all.size() / 9);
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                      std::to_string(all.size() / 3) +
                      "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                      triangles + "\nproperty list uchar uint vertex_indices\nend_header\n";
  for (const double number : all) append(bytes, number);
  for (uint32_t corner = 0; corner < all.size() / 3; corner += 3) {
    bytes += '\3';
    for (uint32_t k = 0; k < 3; ++k) append(bytes, corner + k);
  }
  expect_the_same_bytes("scene.ply", bytes);
}

TEST_P(FormatTest, Obj) {
  const std::vector<double> all = corners();
  std::ostringstream text;
  text << std::setprecision(17);
  for (size_t i = 0; i < all.size(); i += 3)
    text << "v " << all[i] << ' ' << all[i + 1] << ' ' << all[i + 2] << '\n';
  for (size_t corner = 1; corner <= all.size() / 3; corner += 3)
    text << "f " << corner << ' ' << corner + 1 << "// " << corner + 2 << '\n';
  expect_the_same_bytes("scene.obj", text.str());
}

TEST_P(FormatTest, StlBinary) {
  const std::vector<double> all = corners();
  std::string bytes(80, ' ');
  append(bytes, static_cast<uint32_t>(all.size() / 9));
  for (size_t i = 0; i < all.size(); i += 9) {
    bytes.append(12, '\0');  // normal
    for (size_t k = i; k < i + 9; ++k) {
      EXPECT_EQ(all[k], static_cast<float>(all[k])) << "the scene has other numbers than floats";
      append(bytes, static_cast<float>(all[k]));
    }
    append(bytes, uint16_t{0});
  }
  expect_the_same_bytes("scene.stl", bytes);
}

TEST_P(FormatTest, StlText) {
  const std::vector<double> all = corners();
  std::ostringstream text;
  text << std::setprecision(17) << "solid scene\n";
  for (size_t i = 0; i < all.size(); i += 3) {
    if (i % 9 == 0) text << "facet normal 0 0 1\nouter loop\n";
    text << "vertex " << all[i] << ' ' << all[i + 1] << ' ' << all[i + 2] << '\n';
    if (i % 9 == 6) text << "endloop\nendfacet\n";
  }
  text << "endsolid scene\n";
  expect_the_same_bytes("text.stl", text.str());
}

#ifdef VOXDAG_HAS_MESHOPT

// The positions are compressed with meshopt. Each run decodes them to a temporary file in the work
// folder.
TEST_P(FormatTest, Meshopt) {
  const std::vector<double> all = corners();
  std::vector<float> positions(all.begin(), all.end());
  EXPECT_TRUE(std::ranges::equal(positions, all)) << "the scene has other numbers than floats";
  const size_t count = positions.size() / 3;
  std::string data(meshopt_encodeVertexBufferBound(count, 12), '\0');
  data.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(data.data()), data.size(),
                                         positions.data(), count, 12));
  std::string json =
      R"({"asset":{"version":"2.0"},"extensionsRequired":["EXT_meshopt_compression"],"buffers":[{"byteLength":)" +
      std::to_string(data.size()) +
      R"(},{"byteLength":1}],"bufferViews":[{"buffer":1,"byteLength":)" +
      std::to_string(12 * count) +
      R"(,"byteStride":12,"extensions":{"EXT_meshopt_compression":{"buffer":0,"byteLength":)" +
      std::to_string(data.size()) + R"(,"byteStride":12,"count":)" + std::to_string(count) +
      R"(,"mode":"ATTRIBUTES"}}}],"accessors":[{"bufferView":0,"componentType":5126,"count":)" +
      std::to_string(count) +
      R"(,"type":"VEC3"}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  data.resize((data.size() + 3) / 4 * 4, '\0');
  std::string bytes = "glTF";
  append(bytes, uint32_t{2});
  append(bytes, static_cast<uint32_t>(28 + json.size() + data.size()));
  append(bytes, static_cast<uint32_t>(json.size()));
  bytes += "JSON" + json;
  append(bytes, static_cast<uint32_t>(data.size()));
  bytes += std::string("BIN\0", 4) + data;
  expect_the_same_bytes("compressed.glb", bytes);
}

#endif

INSTANTIATE_TEST_SUITE_P(Ingested, FormatTest, testing::Values(Ingested::kDurable), name_of);

}  // namespace
}  // namespace crash
