// Builds that share subvolumes through a cache. Cached results are copied, and the bytes of the
// file are the same.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "scene/generate/generate.h"
#include "scheduler/run_build.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

class CacheTest : public testing::Test {
 protected:
  void SetUp() override {
    GenerateOptions options;
    options.kind = SceneKind::kCity;
    options.triangles = 5000;
    NoProgress progress;
    CancelToken cancel;
    generate_scene(system_files(), folder_.file("city.glb"), options, progress, cancel);
    grid_ = build(spec()).grid;
  }

  // Adds a triangle whose edges are a hundredth of the scene's edge. Its node is moved by `steps`
  // of these edges.
  void write_chair(double steps) const {
    const double edge = grid_.edge / 100;
    const auto number = [](double value) { return std::to_string(value); };
    std::ofstream(folder_.file("chair.gltf"))
        << R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],)"
        << R"( "nodes": [{"mesh": 0, "scale": [)" << number(edge) << "," << number(edge) << ","
        << number(edge) << R"(], "translation": [)" << number(grid_.origin[0] + (40 + steps) * edge)
        << "," << number(grid_.origin[1] + 60 * edge) << "," << number(grid_.origin[2] + 50 * edge)
        << "]}],"
        // Three corners: (0,0,0), (1,0,0), (0,1,0).
        << R"( "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,)"
        << R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],)"
        << R"( "bufferViews": [{"buffer": 0, "byteLength": 36}],)"
        << R"( "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",)"
        << R"( "min": [0, 0, 0], "max": [1, 1, 0]}],)"
        << R"( "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})";
  }
  BuildSpec spec() const {
    BuildSpec spec;
    spec.geometry.scenes = {folder_.file("city.glb")};
    spec.geometry.resolution = 1024;
    spec.run.output = folder_.file("out.vdag");
    spec.run.memory_bytes = uint64_t{256} << 20;
    spec.run.threads = 2;
    spec.run.subvolume_edge = 64;
    return spec;
  }
  BuildSpec spec_with_chair(const std::string& cache) const {
    BuildSpec with = spec();
    with.geometry.scenes.push_back(folder_.file("chair.gltf"));
    with.geometry.bounds = {grid_.origin[0], grid_.origin[1], grid_.origin[2], grid_.edge};
    with.run.cache_folder = cache;
    return with;
  }
  static BuildReport build(const BuildSpec& spec) {
    NoProgress progress;
    CancelToken cancel;
    return run_build(spec, {system_files(), progress, cancel});
  }

  TemporaryFolder folder_;
  Grid grid_;
};

// One node of the scene is moved. The cache provides all subvolumes except the few that the node
// has left or entered. A build without a cache gives the same bytes.
TEST_F(CacheTest, AMovedNodeCostsItsOwnSubvolumes) {
  const std::string cache = folder_.file("cache");
  write_chair(0);
  const BuildReport first = build(spec_with_chair(cache));
  write_chair(8);
  const std::string expected = build(spec_with_chair("")).sha256;
  EXPECT_NE(expected, first.sha256);
  const BuildReport second = build(spec_with_chair(cache));
  EXPECT_EQ(second.sha256, expected);
  EXPECT_GE(static_cast<double>(second.subvolumes_reused),
            0.95 * static_cast<double>(second.subvolumes))
      << second.subvolumes_reused << " of " << second.subvolumes;
  EXPECT_LT(second.subvolumes_reused, second.subvolumes);
}

// A damaged entry is built again. The cache never exceeds its limit. Files that a killed build has
// left in the cache are removed.
TEST_F(CacheTest, DamageLimitAndLeftovers) {
  const std::string cache = folder_.file("cache");
  write_chair(0);
  const BuildReport first = build(spec_with_chair(cache));
  const auto entries = [&] {
    std::vector<std::filesystem::path> paths;
    for (const auto& file : std::filesystem::directory_iterator(cache))
      paths.push_back(file.path());
    return paths;
  };
  const auto all = entries();
  ASSERT_GT(all.size(), 10u);
  for (const auto& path : all) {
    EXPECT_EQ(path.extension(), ".vdart");
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(40);
    file << "damage";
  }
  const std::string left = all[0].string() + ".partial-1-2";
  std::ofstream(left) << "half";
  std::filesystem::last_write_time(
      left, std::filesystem::file_time_type::clock::now() - std::chrono::hours(2));

  BuildSpec limited = spec_with_chair(cache);
  limited.run.cache_bytes = 20000;
  const BuildReport again = build(limited);
  EXPECT_EQ(again.sha256, first.sha256);
  EXPECT_LT(again.subvolumes_cached, first.subvolumes / 2);
  EXPECT_FALSE(std::filesystem::exists(left));
  uint64_t bytes = 0;
  for (const auto& path : entries()) bytes += std::filesystem::file_size(path);
  EXPECT_LE(bytes, limited.run.cache_bytes);
}

}  // namespace
}  // namespace voxdag
