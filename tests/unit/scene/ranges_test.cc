// Any range of a scene can be read, by any number of cursors.
#include <gtest/gtest.h>

#include <limits>

#include "core/base/error.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

constexpr uint32_t kBeyond = 1000;  // no vertex has that index

// Returns a scene with a mesh of two primitives, each of which has an invalid triangle. Three nodes
// have this mesh; the second node has five instances.
SceneBuilder repeated_meshes() {
  SceneBuilder scene;
  std::vector<float> corners;
  for (int i = 0; i < 60; ++i) corners.push_back(static_cast<float>(i * i % 37));
  corners.back() = std::numeric_limits<float>::infinity();
  const int positions = scene.add_positions(corners);
  const int indices =
      scene.add_accessor<uint32_t>("SCALAR", kU32, {0, 1, 2, 3, kBeyond, 5, 6, 7, 8, 9, 10, 11});
  const int mesh =
      scene.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}});
  scene.root["meshes"][static_cast<size_t>(mesh)]["primitives"].push_back(
      {{"attributes", {{"POSITION", positions}}}, {"mode", 5}});
  scene.add_root({{"mesh", mesh}, {"translation", {1, 0, 0}}});
  const int places =
      scene.add_accessor<float>("VEC3", kF32, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15});
  scene.add_root(
      {{"mesh", mesh},
       {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}}});
  scene.root["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  scene.add_root({{"mesh", mesh}, {"translation", {0, 9, 0}}});
  return scene;
}

Corners corners_of(const RealTriangle& triangle) {
  Corners corners;
  for (size_t k = 0; k < 3; ++k) std::copy_n(triangle.v[k], 3, corners[k].begin());
  return corners;
}

// Returns the triangles from number `first` to `end`. Checks that read_snapped() and read_bounds()
// give the same triangles, snapped, and their bounds.
std::vector<Corners> triangles_between(TriangleCursor& cursor, uint64_t first, uint64_t end) {
  const Grid grid = Grid::given({-3, 2, 0.1}, 70, 10);
  std::vector<Corners> all, all_snapped, read_snapped;
  WorldBounds bounds;
  cursor.read(first, end - first, [&](std::span<const WorldTriangle> batch) {
    EXPECT_TRUE(!batch.empty() && batch.size() <= 1024);
    bounds.add(bounds_of(batch));
    for (RealTriangle t : batch) {
      all.push_back(corners_of(t));
      for (auto& vertex : t.v) snap_vertices(grid, vertex);
      all_snapped.push_back(corners_of(t));
    }
  });
  const WorldBounds read_bounds = cursor.read_bounds(first, end - first);
  EXPECT_EQ(read_bounds.empty, bounds.empty);
  EXPECT_EQ(read_bounds.low, bounds.low);
  EXPECT_EQ(read_bounds.high, bounds.high);
  cursor.read_snapped(first, end - first, grid, [&](std::span<const SnappedTriangle> batch) {
    EXPECT_TRUE(!batch.empty() && batch.size() <= 1024);
    for (const SnappedTriangle& t : batch) read_snapped.push_back(corners_of(t));
  });
  EXPECT_EQ(read_snapped, all_snapped);
  return all;
}

// Reads ranges of the declared triangles in any order, and compares them with triangles that are
// read one by one.
TEST(SceneRanges, AnyTriangleMayBeTheFirst) {
  OpenScene open(repeated_meshes().glb(), {true});
  const uint64_t declared = open.source->declared_triangles();
  ASSERT_EQ(declared, 7u * (4 + 18));
  const auto cursor = open.source->open(1);
  std::vector<std::vector<Corners>> each;
  size_t valid = 0;
  for (uint64_t i = 0; i < declared; ++i) {
    each.push_back(triangles_between(*cursor, i, i + 1));
    valid += each.back().size();
  }
  EXPECT_EQ(valid, declared - 14);
  for (uint64_t first = 0; first <= declared; ++first)
    for (uint64_t end = first; end <= declared; end += 5) {
      std::vector<Corners> expected;
      for (uint64_t i = first; i < end; ++i)
        expected.insert(expected.end(), each[i].begin(), each[i].end());
      ASSERT_EQ(triangles_between(*cursor, first, end), expected) << first << " to " << end;
    }
}

// Two cursors take turns reading pieces of a scene. The scene has several instances and files, and
// each mesh has more triangles than a cursor reads in one step. Most triangles use the first
// vertices, and the last triangles also use the last vertices. No triangle uses the vertices
// between them.
TEST(SceneRanges, CursorsDoNotDisturbEachOther) {
  SceneBuilder scene;
  constexpr int kNear = 3000, kFar = 80'000, kVertices = kFar + kNear;
  std::vector<float> corners;
  for (int i = 0; i < 3 * kVertices; ++i)
    corners.push_back(i < 3 * kNear || i >= 3 * kFar ? static_cast<float>(i % 1009) : 1e6f);
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < 3 * 5000; ++i)
    indices.push_back(i * 7 % kNear + (i % 3 == 1 && i > 3 * 4700 ? kFar : 0));
  indices[3 * 17] = indices[3 * 4710] = kBeyond * 1000;
  const int positions = scene.add_positions(corners);
  const int index_accessor = scene.add_accessor("SCALAR", kU32, indices);
  scene.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", index_accessor}});
  for (int i = 0; i < 3; ++i) scene.add_root({{"mesh", 0}, {"translation", {i, 0, 0}}});
  MemoryFiles files;
  files.contents["a.glb"] = files.contents["b.glb"] = scene.glb();
  MemoryBudget budget(uint64_t{1} << 30);
  const CancelToken never;
  const auto source = open_scene(files, {"a.glb", "b.glb"}, {.skip_invalid = true}, budget, never);
  const std::vector<Corners> whole = triangles_of(*source);
  ASSERT_EQ(source->declared_triangles(), 2u * 3 * 5000);
  EXPECT_EQ(whole.size(), 2u * 3 * 4998);
  for (const uint64_t piece : {700u, 4096u, 5000u, 16384u}) {
    SCOPED_TRACE(piece);
    const std::unique_ptr<TriangleCursor> cursors[] = {source->open(2), source->open(2)};
    std::vector<Corners> all;
    for (uint64_t first = 0, i = 0; first < source->declared_triangles(); first += piece, ++i) {
      const uint64_t end = std::min(first + piece, source->declared_triangles());
      const auto part = triangles_between(*cursors[i % 2], first, end);
      all.insert(all.end(), part.begin(), part.end());
    }
    EXPECT_EQ(all, whole);
  }
}

}  // namespace
}  // namespace voxdag::test
