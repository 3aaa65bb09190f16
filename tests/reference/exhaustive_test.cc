// Builds all cases, or a regular sample, of small scenes, and compares each file with the oracle's.
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using Exhaustive = Reference;

// Returns a triangle inside one voxel.
oracle::Triangle dot(int64_t x, int64_t y, int64_t z) {
  const oracle::Point p = {256 * x + 101, 256 * y + 101, 256 * z + 101};
  return {p, {p[0] + 20, p[1], p[2]}, {p[0], p[1] + 20, p[2] + 20}};
}

// In a grid of 4^3 voxels, the root is a brick. The file equals the oracle's for each voxel: alone
// if its number is even, and together with voxel 0 if its number is odd.
TEST_F(Exhaustive, EveryVoxelOfABrick) {
  for (int v = 0; v < 64; ++v) {
    SCOPED_TRACE(v);
    Triangles scene = {dot(v / 16, v / 4 % 4, v % 4)};
    if (v % 2) scene.push_back(dot(0, 0, 0));
    expect_right(scene, 4, spec_for(scene, 4));
    if (HasFailure()) return;
  }
}

// For many masks, builds a scene in which each octant of the mask is one subvolume. All subvolumes
// have the same voxels, relative to their own corners. So the root, which is a node of the top
// tree, has this mask, and all its children are the same node. If the merge ignored the mask,
// voxels would move to other octants.
TEST_F(Exhaustive, EveryMaskOfTheTopTree) {
  for (int mask = 1; mask < 256; mask += mask < 32 ? 1 : 7) {
    SCOPED_TRACE(mask);
    Triangles scene;
    for (int c = 0; c < 8; ++c)
      if (mask >> c & 1) scene.push_back(dot(64 * (c / 4) + 5, 64 * (c / 2 % 2) + 6, 64 * (c % 2)));
    auto spec = spec_for(scene, 128);
    spec.run.subvolume_edge = 64;
    spec.geometry.hash_bits = mask % 2 ? 4 : 64;
    const auto report = expect_right(scene, 128, spec);
    EXPECT_EQ(report.subvolumes, static_cast<uint64_t>(__builtin_popcount(mask)));
    if (HasFailure()) return;
  }
}

// Equal sub-DAGs occur in different octants of different parents. When the merge rewires the two
// levels above them, each octant must keep its child.
TEST_F(Exhaustive, EqualSubDagsOfDifferentParents) {
  for (int i = 0; i < 8; ++i)
    for (int j = i % 2; j < 8; j += 2) {
      SCOPED_TRACE(testing::Message() << i << ' ' << j);
      const auto at = [](int parent, int child) {
        return dot(128 * (parent / 4) + 64 * (child / 4) + 9,
                   128 * (parent / 2 % 2) + 64 * (child / 2 % 2) + 8,
                   128 * (parent % 2) + 64 * (child % 2) + 7);
      };
      const Triangles scene = {at(0, i), at(7, j), at(5, i)};
      auto spec = spec_for(scene, 256);
      spec.run.subvolume_edge = 64;
      expect_right(scene, 256, spec);
      if (HasFailure()) return;
    }
}

}  // namespace
}  // namespace reference
