// Builds that share subvolumes through a cache. Cached results are copied, and the bytes of the
// file are the same.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

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

  // Writes chair.gltf, a triangle whose edges are a hundredth of the edge of the grid. Its node is
  // moved by `steps` times this length.
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

// After one node of the scene is moved, the cache provides all subvolumes except the few that the
// node has left or entered. A build without a cache gives the same bytes.
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

// A build does not use damaged entries of the cache. It keeps the cache within its limit, and
// removes partial files of killed builds.
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

// Damages random entries of a cache, or replaces them with links, pipes, folders and entries of
// other subvolumes, until this object is destroyed.
class CacheAttack {
 public:
  CacheAttack(std::filesystem::path folder, unsigned seed)
      : folder_(std::move(folder)), random_(seed), thread_([this](const std::stop_token& end) {
          while (!end.stop_requested()) attack();
        }) {}
  uint64_t attacks() const { return attacks_; }

 private:
  std::filesystem::path any_entry() {
    std::vector<std::filesystem::path> paths;
    std::error_code failure;
    for (std::filesystem::directory_iterator at(folder_, failure), end; at != end && !failure;
         at.increment(failure))
      paths.push_back(at->path());
    return paths.empty() ? folder_ / "none.vdart" : paths[random_() % paths.size()];
  }
  void flip(const std::filesystem::path& path) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(random_() % 4096));
    file.put(static_cast<char>(random_()));
  }
  void attack() {
    const std::filesystem::path path = any_entry(), other = any_entry();
    std::error_code ignored;
    const unsigned kind = random_() % 8;
    const bool is_file = std::filesystem::is_regular_file(path, ignored);
    if (kind == 0 && is_file) std::filesystem::resize_file(path, random_() % 4096, ignored);
    if (kind == 1 && is_file) flip(path);
    if (kind == 2 && is_file) std::filesystem::resize_file(path, uint64_t{256} << 20, ignored);
    if (kind >= 3) std::filesystem::remove_all(path, ignored);
    if (kind == 3) std::filesystem::create_symlink(other, path, ignored);
    if (kind == 4) std::filesystem::create_symlink("/dev/zero", path, ignored);
    if (kind == 5) mkfifo(path.c_str(), 0666);
    if (kind == 6) std::filesystem::create_directory(path, ignored);
    if (kind == 7 && std::filesystem::is_regular_file(other, ignored))
      std::filesystem::copy_file(other, path, ignored);  // the entry of another key
    ++attacks_;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }

  const std::filesystem::path folder_;
  std::mt19937 random_;
  std::atomic<uint64_t> attacks_{0};
  std::jthread thread_;  // the last member, because the thread uses the other members
};

// Links, pipes, folders, and damaged, huge or exchanged files in the cache neither change the
// result nor stop the build, even if they appear while the build reads or adds entries.
TEST_F(CacheTest, SurvivesHostileEntries) {
  write_chair(0);
  const BuildSpec attacked = spec_with_chair(folder_.file("cache"));
  const std::string expected = build(spec_with_chair("")).sha256;
  EXPECT_EQ(build(attacked).sha256, expected);
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  CacheAttack attack(attacked.run.cache_folder, seed);
  uint64_t cached = 0;
  // A loaded machine can run several builds before the attacking thread gets any CPU time.
  for (int round = 0; round < 4 || attack.attacks() <= 20 || cached == 0; ++round) {
    ASSERT_LT(round, 1000) << attack.attacks() << " attacks, " << cached << " cached";
    const BuildReport report = build(attacked);
    ASSERT_EQ(report.sha256, expected);
    cached += report.subvolumes_cached;
  }
}

}  // namespace
}  // namespace voxdag
