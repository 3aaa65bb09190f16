// A pass over a scene may begin anywhere: it gives what a whole pass gives from there on.
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/unit/scene/scene_files.h"

namespace voxdag::test {
namespace {

constexpr uint32_t kBeyond = 1000;  // no vertex has that index

// A mesh of two primitives, one with an invalid triangle, drawn by a node, by one with five
// instances, and by a third.
SceneBuilder repeated_meshes() {
  SceneBuilder scene;
  std::vector<float> corners;
  for (int i = 0; i < 60; ++i) corners.push_back(static_cast<float>(i * i % 37));
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

std::vector<Corners> triangles_from(TriangleSource& source, uint64_t first) {
  std::vector<Corners> all;
  source.for_each_batch_from(first, [&](std::span<const WorldTriangle> batch) {
    for (const WorldTriangle& t : batch) {
      Corners corners;
      for (size_t k = 0; k < 3; ++k) std::copy_n(t.v[k], 3, corners[k].begin());
      all.push_back(corners);
    }
  });
  return all;
}

// From every declared triangle on: the same tail, and the invalid ones of the tail counted.
TEST(ScenePosition, AnyTriangleMayBeTheFirst) {
  OpenScene open(repeated_meshes().glb(), {true});
  const std::vector<Corners> whole = triangles_of(*open.source);
  const uint64_t declared = open.source->declared_triangles();
  ASSERT_EQ(declared, 7u * (4 + 18));
  ASSERT_EQ(whole.size() + open.source->invalid_triangles(), declared);
  EXPECT_EQ(open.source->position(), declared);
  for (uint64_t first = 0; first <= declared; ++first) {
    SCOPED_TRACE(first);
    const std::vector<Corners> tail = triangles_from(*open.source, first);
    ASSERT_EQ(tail.size() + open.source->invalid_triangles(), declared - first);
    EXPECT_TRUE(std::equal(tail.rbegin(), tail.rend(), whole.rbegin()));
    EXPECT_EQ(open.source->position(), declared);
  }
}

// Where a visited batch ends is where the next one begins, across windows, instances and scenes.
TEST(ScenePosition, GoesOnWhereABatchEnded) {
  SceneBuilder scene;
  std::vector<float> corners;
  for (int i = 0; i < 3 * 3000; ++i) corners.push_back(static_cast<float>(i % 1009));
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < 3 * 5000; ++i) indices.push_back(i * 7 % 3000);
  indices[3 * 17] = indices[3 * 4096] = kBeyond * 1000;
  const int positions = scene.add_positions(corners);
  const int index_accessor = scene.add_accessor("SCALAR", kU32, indices);
  scene.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", index_accessor}});
  for (int i = 0; i < 3; ++i) scene.add_root({{"mesh", 0}, {"translation", {i, 0, 0}}});
  OpenScene open(scene.glb(), {true});
  const std::vector<Corners> whole = triangles_of(*open.source);
  struct Mark {
    uint64_t position, valid;
  };
  std::vector<Mark> marks;
  uint64_t valid = 0;
  open.source->for_each_batch([&](std::span<const WorldTriangle> batch) {
    marks.push_back({open.source->position(), valid += batch.size()});
  });
  ASSERT_EQ(marks.size(), 4u);
  for (const Mark& mark : marks) {
    SCOPED_TRACE(mark.position);
    const std::vector<Corners> tail = triangles_from(*open.source, mark.position);
    ASSERT_EQ(tail.size(), whole.size() - mark.valid);
    EXPECT_TRUE(std::equal(tail.rbegin(), tail.rend(), whole.rbegin()));
  }
}

}  // namespace
}  // namespace voxdag::test
