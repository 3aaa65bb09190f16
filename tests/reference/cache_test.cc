// Builds that share subvolumes through a cache. Unchanged subvolumes are copied from the cache,
// which does not change the bytes of the file.
#include <filesystem>
#include <fstream>

#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using CacheTest = Reference;

// Returns a room with many small objects, and a chair whose lowest x is chair_x_voxels.
Triangles room_with_chair(int resolution, int64_t chair_x_voxels) {
  Triangles scene =
      oracle::make_scene(oracle::SceneKind::kSubVoxel, 3, {{0, 0, 0}, resolution}, 4000);
  const int64_t low = chair_x_voxels;
  for (const auto& t : oracle::make_scene(oracle::SceneKind::kSoup, 4, {{low, 40, 40}, 8}, 30))
    scene.push_back(t);
  return scene;
}

// Between two builds only a chair moves. The cache provides at least 95 % of the second build's
// subvolumes, and the file equals the file of a build without a cache.
TEST_F(CacheTest, OneChairMoved) {
  constexpr int kResolution = 1024;
  auto before = spec_for(room_with_chair(kResolution, 100), kResolution);
  before.run.cache_folder = folder_.file("cache");
  before.run.subvolume_edge = 64;
  const auto first = run(before);
  EXPECT_EQ(first.subvolumes_cached, 0u);
  EXPECT_GT(first.subvolumes, 1000u);

  auto after = spec_for(room_with_chair(kResolution, 700), kResolution);
  after.run.subvolume_edge = 64;
  const auto from_scratch = run(after);
  after.run.cache_folder = before.run.cache_folder;
  const auto cached = run(after);
  EXPECT_EQ(cached.sha256, from_scratch.sha256);
  EXPECT_NE(cached.sha256, first.sha256);
  EXPECT_GE(cached.subvolumes_cached * 100, cached.subvolumes * 95);
  EXPECT_LT(cached.subvolumes_cached, cached.subvolumes);
  EXPECT_EQ(run(before).subvolumes_cached, first.subvolumes);
}

// A subvolume has the same cache entry if its triangles are moved together with it, are stored in
// another order or with rotated vertices, or occur twice.
TEST_F(CacheTest, ContentIsRelativeAndCanonical) {
  const Triangles scene = oracle::make_scene(oracle::SceneKind::kSoup, 5, {{0, 0, 0}, 64}, 40);
  Triangles moved = scene;
  for (auto& t : moved) {
    for (auto& corner : t)
      for (auto& u : corner) u += 64 * 256;
    std::swap(t[0], t[2]);
  }
  std::swap(moved.front(), moved.back());
  moved.push_back(moved.front());
  auto spec = spec_for(scene, 256);
  spec.run.cache_folder = folder_.file("cache");
  spec.run.subvolume_edge = 64;
  expect_right(scene, 256, spec);
  auto other = spec_for(moved, 256);
  other.run = spec.run;
  const auto report = expect_right(moved, 256, other);
  EXPECT_GT(report.subvolumes_cached, 0u);
}

// A build does not use the cache entry of a subvolume if the build has other hash bits, if the
// entry is damaged, or if a small limit has evicted the entry.
TEST_F(CacheTest, MissesWhatItMust) {
  const Triangles scene = oracle::make_scene(oracle::SceneKind::kSoup, 6, {{0, 0, 0}, 256}, 60);
  auto spec = spec_for(scene, 256);
  spec.run.cache_folder = folder_.file("cache");
  spec.run.subvolume_edge = 64;
  const auto first = expect_right(scene, 256, spec);
  auto cut = spec;
  cut.geometry.hash_bits = 16;
  EXPECT_EQ(expect_right(scene, 256, cut).subvolumes_cached, 0u);

  uint64_t entries = 0;
  for (const auto& entry : std::filesystem::directory_iterator(spec.run.cache_folder)) {
    ++entries;
    std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(50);
    const char byte = static_cast<char>(file.get() ^ 1);
    file.seekp(50);
    file.put(byte);
  }
  EXPECT_GT(entries, 10u);
  const auto damaged = run(spec);
  EXPECT_EQ(damaged.subvolumes_cached, 0u);
  EXPECT_EQ(damaged.sha256, first.sha256);

  spec.run.cache_bytes = 20000;
  spec.geometry.hash_bits = 32;
  run(spec);
  uint64_t bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(spec.run.cache_folder))
    bytes += entry.file_size();
  EXPECT_LE(bytes, spec.run.cache_bytes);
}

}  // namespace
}  // namespace reference
