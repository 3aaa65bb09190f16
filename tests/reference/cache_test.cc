// Builds that share subvolumes through a cache. Unchanged subvolumes are copied from the cache,
// which does not change the bytes of the file.
#include <array>
#include <filesystem>
#include <fstream>
#include <utility>

#include "tests/oracle/solid/solids.h"
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

// A rectangle: its plane is at `at` along `axis`, in voxels, and faces the positive axis if
// `is_positive`. `low` and `high` are its extents along the other two axes.
struct Sheet {
  int axis;
  int64_t at;
  std::array<int64_t, 2> low, high;
  bool is_positive;
};

void add_sheet(const Sheet& sheet, Triangles& out) {
  const auto corner = [&](bool first, bool second) {
    oracle::Point p{};
    const int u = (sheet.axis + 1) % 3, v = (sheet.axis + 2) % 3;
    p[sheet.axis] = 256 * sheet.at + 129;
    p[u] = 256 * (first ? sheet.high : sheet.low)[0] + 129;
    p[v] = 256 * (second ? sheet.high : sheet.low)[1] + 129;
    return p;
  };
  const oracle::Point a = corner(false, false), b = corner(true, false), c = corner(true, true),
                      d = corner(false, true);
  out.push_back(sheet.is_positive ? oracle::Triangle{a, b, c} : oracle::Triangle{a, c, b});
  out.push_back(sheet.is_positive ? oracle::Triangle{a, c, d} : oracle::Triangle{a, d, c});
}

// Returns a tube along z that is open at both ends, a closed box, and a sheet far away from both.
// Inside the tube, 4 of the 6 directions (core/geometry/solid_rule.h) count as inside, because of
// its walls along x and y. If the tube and the sheet have the same y, the sheet changes one of
// these directions, so only 3 count as inside and the tube is not filled.
Triangles tube_box_and_sheet(int64_t sheet_y) {
  Triangles out;
  const auto add_box = [&](std::array<int64_t, 3> low, std::array<int64_t, 3> high, int axes) {
    for (int a = 0; a < axes; ++a) {
      const int u = (a + 1) % 3, v = (a + 2) % 3;
      for (const bool is_high : {false, true})
        add_sheet({a, (is_high ? high : low)[a], {low[u], low[v]}, {high[u], high[v]}, is_high},
                  out);
    }
  };
  add_box({40, 40, 40}, {150, 150, 210}, 2);
  add_box({300, 300, 300}, {450, 450, 450}, 3);
  add_sheet({0, 480, {sheet_y, 20}, {sheet_y + 160, 230}, false}, out);
  return out;
}

void expect_same_report(const voxdag::BuildReport& report, const voxdag::BuildReport& expected) {
  EXPECT_EQ(report.sha256, expected.sha256);
  ASSERT_TRUE(report.solid);
  EXPECT_EQ(report.solid->interior, expected.solid->interior);
  EXPECT_EQ(report.solid->disputed, expected.solid->disputed);
  EXPECT_EQ(report.solid->open_rows, expected.solid->open_rows);
}

// Whether the tube is filled depends on a sheet in another part of the grid. After the sheet moves,
// the subvolumes of the tube are built again, and the subvolumes of the box are not.
TEST_F(CacheTest, ASolidDependsOnItsViews) {
  for (const auto rule : {voxdag::SolidName::kWinding, voxdag::SolidName::kParity}) {
    auto before = spec_for(tube_box_and_sheet(20), 512);
    auto after = spec_for(tube_box_and_sheet(340), 512);
    for (auto* spec : {&before, &after}) {
      spec->geometry.solid = rule;
      spec->run.subvolume_edge = 64;
    }
    const auto without_cache = run(before), moved = run(after);
    EXPECT_GT(moved.solid->interior, without_cache.solid->interior + 1000000);
    before.run.cache_folder = after.run.cache_folder = folder_.file("cache");
    const auto first = run(before);
    expect_same_report(first, without_cache);
    const auto again = run(before);
    expect_same_report(again, without_cache);
    EXPECT_GT(again.subvolumes_cached, 50u);
    const auto cached = run(after);
    expect_same_report(cached, moved);
    EXPECT_GT(cached.subvolumes_cached, 20u);
    EXPECT_LT(cached.subvolumes_cached + 20, again.subvolumes_cached);
    // The shell does not share the cache entries of the solid.
    after.geometry.solid = voxdag::SolidName::kNone;
    const auto shell = run(after);
    after.run.cache_folder.clear();
    EXPECT_EQ(run(after).sha256, shell.sha256);
  }
}

// If triangles of a solid occur twice or with the opposite orientation, its subvolumes have other
// cache entries.
TEST_F(CacheTest, ASolidDependsOnOrientationAndCopies) {
  const Triangles once = oracle::make_solid(oracle::SolidKind::kSphere, 3, 64);
  Triangles twice = once, both = once;
  twice.insert(twice.end(), once.begin(), once.end());
  for (auto t : once) {
    std::swap(t[0], t[1]);
    both.push_back(t);
  }
  for (const auto rule : {voxdag::SolidName::kWinding, voxdag::SolidName::kParity})
    for (const Triangles& scene : {once, twice, both}) {
      auto spec = spec_for(scene, 64);
      spec.geometry.solid = rule;
      const auto expected = run(spec);
      spec.run.cache_folder = folder_.file("cache");
      expect_same_report(run(spec), expected);
      const auto again = run(spec);
      expect_same_report(again, expected);
      EXPECT_EQ(again.subvolumes_cached, 1u);
    }
}

}  // namespace
}  // namespace reference
