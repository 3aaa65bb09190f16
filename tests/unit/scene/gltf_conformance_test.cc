// Tests the files of the conformance set and real scenes, which are stored outside of this
// repository. Their manifests list the expected triangles, bounds and refusals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <unordered_map>

#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

namespace fs = std::filesystem;

const fs::path kScenes = VOXDAG_SHARED_SCENES;

// One line of a manifest.
struct Entry {
  std::string file;
  std::string triangles;  // "" if the line has no number
  std::string expect;     // "" in the manifest of the real scenes
  std::string bounds;
};

std::vector<Entry> read_manifest(const fs::path& path, size_t expect_column, size_t bounds_column) {
  std::vector<Entry> entries;
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);  // the names of the columns
  while (std::getline(in, line)) {
    std::vector<std::string> cells;
    std::istringstream cut(line);
    for (std::string cell; std::getline(cut, cell, '\t');) cells.push_back(cell);
    cells.resize(16);
    entries.push_back(
        {cells[0], cells[1], expect_column ? cells[expect_column] : "", cells[bounds_column]});
  }
  return entries;
}

struct Opened {
  explicit Opened(const fs::path& path) : budget(uint64_t{64} << 20) {
    source = open_scene(system_files(), {path.string()}, {}, budget, cancel);
  }
  MemoryBudget budget;
  CancelToken cancel;
  std::unique_ptr<TriangleSource> source;
};

void expect_refused(const fs::path& path, const std::string& word = "") {
  try {
    Opened opened(path);
    triangles_of(*opened.source);
    ADD_FAILURE() << path << " was read";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInvalidInput) << e.message();
    EXPECT_NE(e.message().find(word), std::string::npos) << e.message();
  }
}

// Returns the largest magnitude of all coordinates. Tolerances are relative to it.
double magnitude(const std::vector<Corners>& triangles) {
  double largest = 0;
  for (const Corners& t : triangles)
    for (const auto& corner : t)
      for (double x : corner) largest = std::max(largest, std::abs(x));
  return largest;
}

std::vector<Corners> read_obj(const fs::path& path) {
  std::vector<std::array<double, 3>> vertices;
  std::vector<Corners> triangles;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      auto& v = vertices.emplace_back();
      words >> v[0] >> v[1] >> v[2];
    } else if (kind == "f") {
      size_t a = 0, b = 0, c = 0;
      words >> a >> b >> c;
      triangles.push_back({vertices.at(a - 1), vertices.at(b - 1), vertices.at(c - 1)});
    }
  }
  return triangles;
}

// Returns the largest difference between coordinates, for the best pairing of the corners.
double distance(const Corners& a, const Corners& b) {
  double best = INFINITY;
  std::array<size_t, 3> order = {0, 1, 2};
  do {
    double worst = 0;
    for (size_t k = 0; k < 3; ++k)
      for (size_t axis = 0; axis < 3; ++axis)
        worst = std::max(worst, std::abs(a[k][axis] - b[order[k]][axis]));
    best = std::min(best, worst);
  } while (std::ranges::next_permutation(order).found);
  return best;
}

// Compares two multisets of triangles in any order and winding. Each expected triangle is paired
// with the nearest remaining triangle. Triangles are indexed by the cell of their centroid; the
// search includes the neighboring cells, so that rounding does not hide a triangle.
void expect_same_triangles(const std::vector<Corners>& found,
                           const std::vector<Corners>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  // The coordinates of the expected triangles were rounded to floats or to nine digits.
  const double tolerance = 7e-8 * magnitude(expected);
  const double cell = std::max(8 * tolerance, 1e-300);
  const auto cell_of = [&](const Corners& t, size_t axis) {
    return std::llround((t[0][axis] + t[1][axis] + t[2][axis]) / 3 / cell);
  };
  const auto key = [](long long x, long long y, long long z) {
    return static_cast<uint64_t>(x) * 73856093u ^ static_cast<uint64_t>(y) * 19349669u ^
           static_cast<uint64_t>(z) * 83492791u;
  };
  std::unordered_multimap<uint64_t, const Corners*> left;
  for (const Corners& t : found) left.emplace(key(cell_of(t, 0), cell_of(t, 1), cell_of(t, 2)), &t);
  const auto take_nearest = [&](const Corners& wanted) {
    auto nearest = left.end();
    double nearest_distance = tolerance;
    for (int around = 0; around < 27; ++around) {
      auto [it, last] = left.equal_range(key(cell_of(wanted, 0) + around / 9 - 1,
                                             cell_of(wanted, 1) + around / 3 % 3 - 1,
                                             cell_of(wanted, 2) + around % 3 - 1));
      for (; it != last; ++it) {
        const double d = distance(*it->second, wanted);
        if (d > nearest_distance) continue;
        nearest = it;
        nearest_distance = d;
      }
    }
    if (nearest == left.end()) return false;
    left.erase(nearest);
    return true;
  };
  size_t missing = 0;
  for (const Corners& wanted : expected) missing += !take_nearest(wanted);
  EXPECT_EQ(missing, 0u) << "of " << expected.size();
}

// Compares the bounds with the six numbers in the manifest, which have six digits.
void expect_bounds(const std::vector<Corners>& triangles, const std::string& bounds) {
  std::array<double, 6> expected{}, found{};
  std::istringstream words(bounds);
  for (double& x : expected) words >> x;
  for (size_t axis = 0; axis < 3; ++axis) {
    found[axis] = INFINITY;
    found[axis + 3] = -INFINITY;
    for (const Corners& t : triangles)
      for (const auto& corner : t) {
        found[axis] = std::min(found[axis], corner[axis]);
        found[axis + 3] = std::max(found[axis + 3], corner[axis]);
      }
  }
  for (size_t k = 0; k < 6; ++k)
    EXPECT_NEAR(found[k], expected[k], 1e-5 * std::abs(expected[k])) << "bound " << k;
}

class GltfConformance : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kScenes / "conformance" / "MANIFEST.tsv"))
      GTEST_SKIP() << "the shared scenes are not there: " << kScenes;
  }
};

// Every file of the set has the outcome that its line expects.
TEST_F(GltfConformance, Manifest) {
  const fs::path folder = kScenes / "conformance";
  size_t compared = 0, refused = 0;
  for (const Entry& entry : read_manifest(folder / "MANIFEST.tsv", 3, 4)) {
    SCOPED_TRACE(entry.file);
    // The compressed file is tested by RealCompressed.
    if (entry.expect == "refuse-or-decode") continue;
    if (entry.file.ends_with("no_position.glb")) {
      // The manifest expects a refusal. Opening the scene succeeds with no triangles; the build
      // then refuses it.
      EXPECT_EQ(Opened(folder / entry.file).source->declared_triangles(), 0u);
      ++refused;
      continue;
    }
    if (entry.expect == "refuse") {
      expect_refused(folder / entry.file);
      ++refused;
      continue;
    }
    Opened opened(folder / entry.file);
    const auto triangles = triangles_of(*opened.source);
    if (!entry.triangles.empty()) {
      EXPECT_EQ(triangles.size(), std::stoull(entry.triangles));
    }
    EXPECT_EQ(opened.source->declared_triangles(), triangles.size());
    if (!entry.bounds.empty()) expect_bounds(triangles, entry.bounds);
    const fs::path truth =
        folder / "expected" / fs::path(entry.file).filename().replace_extension(".obj");
    if (!fs::exists(truth)) continue;
    expect_same_triangles(triangles, read_obj(truth));
    ++compared;
  }
  EXPECT_EQ(compared, 29u);
  EXPECT_EQ(refused, 18u);
}

// A file without scenes draws its root nodes. Its mesh is the mesh of the set's other files, so the
// expected triangles are those of the file c23.
TEST_F(GltfConformance, WithoutScenes) {
  Opened opened(kScenes / "conformance" / "c22_no_scene.glb");
  expect_same_triangles(triangles_of(*opened.source),
                        read_obj(kScenes / "conformance" / "expected" / "c23_base64.obj"));
}

// Real scenes have the number of triangles and the bounds that the manifest gives. Some lines have
// no bounds.
TEST_F(GltfConformance, RealScenes) {
  size_t read = 0;
  for (const Entry& entry : read_manifest(kScenes / "MANIFEST.tsv", 0, 11)) {
    SCOPED_TRACE(entry.file);
    const bool is_broken = entry.file.find("integer-out-of-bounds") != std::string::npos ||
                           entry.file.find("Draco") != std::string::npos;
    if (entry.triangles.empty() || is_broken || entry.file.ends_with(")")) continue;
    Opened opened(kScenes / entry.file);
    const auto triangles = triangles_of(*opened.source);
    EXPECT_EQ(triangles.size(), std::stoull(entry.triangles));
    if (!entry.bounds.empty()) expect_bounds(triangles, entry.bounds);
    ++read;
  }
  EXPECT_EQ(read, 10u);
}

// Compressed files made by real programs. They are read if voxdag has the library; otherwise the
// message names the extension.
TEST_F(GltfConformance, RealCompressed) {
  const fs::path draco_box = kScenes / "gltf_real" / "Box_Draco.glb";
  const fs::path draco = kScenes / "conformance" / "c25_draco.glb";
  const fs::path meshopt = kScenes / "gltf_real" / "pirate_meshopt.glb";
#ifdef VOXDAG_HAS_DRACO
  Opened box(draco_box);
  const auto triangles = triangles_of(*box.source);
  EXPECT_EQ(triangles.size(), 12u);
  expect_bounds(triangles, "-0.5 -0.5 -0.5 0.5 0.5 0.5");
  Opened sphere(draco);
  EXPECT_EQ(triangles_of(*sphere.source).size(), 504u);
#else
  expect_refused(draco_box, "KHR_draco_mesh_compression");
  expect_refused(draco, "KHR_draco_mesh_compression");
#endif
#ifdef VOXDAG_HAS_MESHOPT
  Opened pirate(meshopt);
  EXPECT_EQ(triangles_of(*pirate.source).size(), 5010u);
#else
  expect_refused(meshopt, "EXT_meshopt_compression");
#endif
}

// Real files that cannot be read are refused with an error that names the reason.
TEST_F(GltfConformance, RealRefusals) {
  const fs::path folder = kScenes / "gltf_real";
  expect_refused(folder / "lfs_pointer_as_bin.gltf", "PrimitiveModes.bin is a Git LFS pointer");
  expect_refused(folder / "gltf10_Cameras.gltf", "glTF version 1.1");
  expect_refused(folder / "integer-out-of-bounds.gltf", "bufferViews[0].byteLength is 1e+300");
}

}  // namespace
}  // namespace voxdag::test
