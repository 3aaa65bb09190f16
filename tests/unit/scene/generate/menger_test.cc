// The voxels and the DAG of the sponge are known from its definition. In the grid whose voxels are
// the unit cells (--bounds 0,0,0,R), each unit face is on the low side of a layer of voxels.
#include <gtest/gtest.h>

#include "scene/generate/generate.h"
#include "tests/oracle/dag.h"
#include "tests/unit/scene/generate/glb.h"
#include "tests/unit/scene/generate/memory_files.h"

using namespace voxdag;

namespace {

std::vector<glb::Triangle> sponge(uint32_t level) {
  MemoryFiles files;
  NoProgress progress;
  const CancelToken cancel;
  GenerateOptions options;
  options.kind = SceneKind::kMenger;
  options.level = level;
  generate_scene(files, "m.glb", options, progress, cancel);
  return glb::File(files.files.at("m.glb")).triangles();
}

int power(int base, uint32_t exponent) {
  int value = 1;
  while (exponent-- > 0) value *= base;
  return value;
}

bool solid(int x, int y, int z, int size) {
  if (x < 0 || y < 0 || z < 0 || x >= size || y >= size || z >= size) return false;
  for (; size > 1; size /= 3, x /= 3, y /= 3, z /= 3)
    if ((x % 3 == 1) + (y % 3 == 1) + (z % 3 == 1) > 1) return false;
  return true;
}

// Computes the voxels from the definition of the sponge. A corner at coordinate k snaps to slightly
// above k. So the unit face between the cells x - 1 and x is in the voxels at x, and reaches from y
// to y + 1 and from z to z + 1. The other axes are alike.
oracle::Voxels expected_voxels(uint32_t level, int resolution) {
  const int size = power(3, level);
  oracle::Voxels voxels(resolution);
  for (int x = 0; x <= size; ++x)
    for (int y = 0; y <= size; ++y)
      for (int z = 0; z <= size; ++z) {
        const bool here = solid(x, y, z, size);
        for (int i = 0; i < 4; ++i) {
          const int a = i & 1, b = i >> 1;
          if (here != solid(x - 1, y, z, size)) voxels.set(x, y + a, z + b);
          if (here != solid(x, y - 1, z, size)) voxels.set(x + a, y, z + b);
          if (here != solid(x, y, z - 1, size)) voxels.set(x + a, y + b, z);
        }
      }
  return voxels;
}

// A sponge of level n has 2 * 20^n + 4 * 8^n faces of two triangles each. No triangle is
// degenerate, and the coordinates of all corners are integers.
TEST(Menger, HasTheKnownNumberOfFaces) {
  for (uint32_t level = 0; level <= 3; ++level) {
    SCOPED_TRACE(level);
    const auto triangles = sponge(level);
    EXPECT_EQ(triangles.size(),
              2u * static_cast<size_t>(2 * power(20, level) + 4 * power(8, level)));
    for (const auto& t : triangles)
      for (const auto& p : t)
        for (const float c : p) ASSERT_EQ(c, static_cast<float>(static_cast<int>(c)));
  }
}

// The triangles set exactly the voxels that follow from the definition.
TEST(Menger, TrianglesSetTheKnownVoxels) {
  for (uint32_t level = 0; level <= 2; ++level) {
    SCOPED_TRACE(level);
    oracle::Triangles snapped;
    for (const auto& t : sponge(level)) {
      oracle::Triangle& out = snapped.emplace_back();
      for (size_t i = 0; i < 3; ++i)
        for (size_t axis = 0; axis < 3; ++axis)
          out[i][axis] = oracle::kUnits * static_cast<int64_t>(t[i][axis]) + 1;
    }
    constexpr int kResolution = 16;
    EXPECT_TRUE(oracle::voxelize(snapped, {{0, 0, 0}, kResolution}) ==
                expected_voxels(level, kResolution));
  }
}

// Computes the table of docs/examples/generate.md from the definition and the oracle's DAG.
TEST(Menger, DagIsAsDocumented) {
  const struct {
    uint32_t level;
    int resolution;
    uint64_t voxels, svo_nodes, dag_nodes;
  } table[] = {{0, 4, 8, 1, 1},
               {1, 4, 64, 1, 1},
               {2, 16, 896, 36, 24},
               {3, 32, 15'232, 397, 280},
               {4, 128, 283'520, 8'116, 2'722},
               {5, 256, 5'501'824, 152'355, 16'882}};
  for (const auto& row : table) {
    SCOPED_TRACE(row.level);
    const oracle::Dag dag = oracle::build_dag(expected_voxels(row.level, row.resolution), 64);
    EXPECT_EQ(dag.voxels, row.voxels);
    EXPECT_EQ(dag.svo_nodes, row.svo_nodes);
    EXPECT_EQ(dag.dag_nodes, row.dag_nodes);
  }
}

}  // namespace
