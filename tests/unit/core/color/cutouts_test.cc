// Tests where a triangle with cutouts is visible.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <vector>

#include "core/color/patches/visible_patches.h"
#include "core/geometry/overlap.h"

namespace voxdag {
namespace {

constexpr uint32_t kLevels = 5;
constexpr int64_t kEdge = int64_t{1} << kLevels;
using Voxel = std::array<int64_t, 3>;
using Voxels = std::set<Voxel>;
using Sight = VisiblePart::Sight;

MemoryBudget& budget() {
  static MemoryBudget all(uint64_t{64} << 20);
  return all;
}

// Returns the cutouts of one material with alpha mode MASK. Texel (x, y) of its image is visible if
// is_visible(x, y) is true.
template <class IsVisible>
Cutouts cutouts_of(uint32_t width, uint32_t height, std::array<Wrap, 2> wrap,
                   const IsVisible& is_visible) {
  Cutouts cutouts;
  Material material;
  material.alpha_mode = AlphaMode::kMask;
  material.image = 0;
  material.wrap = wrap;
  cutouts.materials = {material};
  cutouts.mask_of = {0};
  AlphaMask& mask = cutouts.masks.emplace_back(width, height, budget());
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      if (is_visible(x, y)) mask.set_visible(x, y);
  mask.finish();
  return cutouts;
}

// Returns the triangle with these corners, in voxels, and texture coordinates, where 1 is the size
// of the image.
FixedSurface surface_of(const double (&at)[3][3], const double (&texture)[3][2]) {
  FixedSurface surface;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t a = 0; a < 3; ++a)
      surface.position.v[i][a] = 2 * static_cast<int64_t>(std::floor(128 * at[i][a])) + 1;
    for (size_t a = 0; a < 2; ++a)
      surface.corners[i].texture[a] = std::llround(texture[i][a] * (1 << kTextureBits));
  }
  return surface;
}

FixedSurface random_surface(std::mt19937& random, double images) {
  std::uniform_real_distribution<double> place(-4, kEdge + 4), texture(-images, images);
  double at[3][3], uv[3][2];
  for (auto& corner : at)
    for (double& c : corner) c = place(random);
  for (auto& corner : uv)
    for (double& c : corner) c = texture(random);
  return surface_of(at, uv);
}

bool touches(const FixedTriangle& triangle, const Voxel& voxel) {
  const int64_t low[3] = {voxel[0] * 256, voxel[1] * 256, voxel[2] * 256};
  return triangle_touches_cube(triangle, low, 256);
}

template <class Visit>
void for_each_voxel(const Visit& visit) {
  for (int64_t x = 0; x < kEdge; ++x)
    for (int64_t y = 0; y < kEdge; ++y)
      for (int64_t z = 0; z < kEdge; ++z) visit(Voxel{x, y, z});
}

Voxels touched_voxels(const FixedTriangle& triangle) {
  Voxels all;
  for_each_voxel([&](const Voxel& voxel) {
    if (touches(triangle, voxel)) all.insert(voxel);
  });
  return all;
}

Voxels visible_voxels(const VisiblePart& part) {
  Voxels all;
  for (const Voxel& voxel : touched_voxels(part.triangle()))
    if (part.is_visible(voxel)) all.insert(voxel);
  return all;
}

// Returns the voxels that the patches touch. The patches (visible_patches.h) are triangles that
// together touch exactly the visible voxels.
Voxels voxels_of_patches(const VisiblePart& part) {
  static VisiblePatches patches(kLevels);  // reused, as in builds
  Voxels all;
  patches.for_each(part, [&](const FixedTriangle& patch) {
    const Voxels touched = touched_voxels(patch);
    EXPECT_FALSE(touched.empty());
    all.insert(touched.begin(), touched.end());
    return true;
  });
  return all;
}

// Returns the texel at a point of the triangle, computed without the tested code. `second` and
// `third` are the barycentric weights of the second and the third corner.
std::array<uint32_t, 2> texel_at(const FixedSurface& surface, const Cutouts& cutouts, double second,
                                 double third) {
  std::array<uint32_t, 2> texel;
  const uint32_t size[2] = {cutouts.masks[0].width(), cutouts.masks[0].height()};
  for (size_t a = 0; a < 2; ++a) {
    double u = 0;
    const double weights[3] = {1 - second - third, second, third};
    for (size_t i = 0; i < 3; ++i)
      u += weights[i] * static_cast<double>(surface.corners[i].texture[a]) / (1 << kTextureBits);
    const Wrap wrap = cutouts.materials[0].wrap[a];
    if (wrap == Wrap::kClampToEdge) u = std::clamp(u, 0.0, 1 - 1e-12);
    if (wrap == Wrap::kMirroredRepeat) {
      u = std::fmod(std::fmod(u, 2) + 2, 2);
      if (u > 1) u = 2 - u;
    }
    u -= std::floor(u);
    texel[a] = std::min(static_cast<uint32_t>(u * size[a]), size[a] - 1);
  }
  return texel;
}

constexpr Wrap kWraps[] = {Wrap::kRepeat, Wrap::kMirroredRepeat, Wrap::kClampToEdge};

// If a random point of the triangle has a visible texel, the voxel that contains the point is
// visible. Conversely, nearly every visible voxel contains such a point.
TEST(Cutouts, EqualPointsOfTheTriangle) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  size_t visible = 0, unexplained = 0;
  for (int round = 0; round < 60; ++round) {
    const Wrap wrap = kWraps[round % 3];
    std::vector<bool> bits(7 * 5);
    for (size_t i = 0; i < bits.size(); ++i) bits[i] = random() % 3 == 0;
    const Cutouts cutouts =
        cutouts_of(7, 5, {wrap, wrap}, [&](uint32_t x, uint32_t y) { return bits[7 * y + x]; });
    const FixedSurface surface = random_surface(random, 2);
    const VisiblePart part(surface, cutouts, kLevels);
    const Voxels all = visible_voxels(part);
    Voxels explained;
    for (int i = 0; i < 200000; ++i) {
      double p = unit(random), q = unit(random);
      if (p + q > 1) p = 1 - p, q = 1 - q;
      Voxel voxel;
      for (size_t a = 0; a < 3; ++a) {
        const auto& v = surface.position.v;
        const double at = static_cast<double>(v[0][a]) +
                          p * static_cast<double>(v[1][a] - v[0][a]) +
                          q * static_cast<double>(v[2][a] - v[0][a]);
        voxel[a] = static_cast<int64_t>(std::floor(at / 256));
      }
      const auto [x, y] = texel_at(surface, cutouts, p, q);
      if (!bits[7 * y + x]) continue;
      if (std::ranges::any_of(voxel, [](int64_t c) { return c < 0 || c >= kEdge; })) continue;
      ASSERT_TRUE(all.contains(voxel)) << round;
      explained.insert(voxel);
    }
    visible += all.size();
    unexplained += all.size() - explained.size();
  }
  EXPECT_GT(visible, 3000u);
  EXPECT_LT(unexplained, visible / 25);
}

// The patches touch exactly the voxels that a test of each single voxel finds. is_visible_in()
// returns true for exactly the cubes that contain such a voxel.
TEST(Cutouts, PatchesTouchExactlyTheVisibleVoxels) {
  std::mt19937 random(2);
  size_t visible = 0, hidden = 0;
  for (int round = 0; round < 150; ++round) {
    const uint32_t width = 1u << random() % 8, height = 1 + random() % 90, scale = 1 + random() % 9;
    const std::array<Wrap, 2> wrap{kWraps[random() % 3], kWraps[random() % 3]};
    const Cutouts cutouts = cutouts_of(width, height, wrap, [&](uint32_t x, uint32_t y) {
      return (x / scale * 7 + y / scale * 13) % 3 == 0;
    });
    const VisiblePart part(random_surface(random, round % 5 == 0 ? 0.3 : 3), cutouts, kLevels);
    const Voxels all = visible_voxels(part);
    ASSERT_EQ(voxels_of_patches(part), all) << round;
    visible += all.size();
    hidden += touched_voxels(part.triangle()).size() - all.size();
    for (uint32_t level : {0u, 2u, 4u}) {
      const int64_t edge = kEdge >> level;
      for (int i = 0; i < 8; ++i) {
        const Cube cube{level,
                        {static_cast<uint32_t>(random() % (1u << level)),
                         static_cast<uint32_t>(random() % (1u << level)),
                         static_cast<uint32_t>(random() % (1u << level))}};
        const int64_t low[3] = {cube.position[0] * edge * 256, cube.position[1] * edge * 256,
                                cube.position[2] * edge * 256};
        if (!triangle_touches_cube(part.triangle(), low, edge * 256)) continue;
        const bool any = std::ranges::any_of(all, [&](const Voxel& voxel) {
          for (size_t a = 0; a < 3; ++a)
            if (voxel[a] / edge != cube.position[a]) return false;
          return true;
        });
        ASSERT_EQ(part.is_visible_in(cube), any) << round;
      }
    }
  }
  EXPECT_GT(visible, 5000u);
  EXPECT_GT(hidden, 5000u);
}

// If the visitor stops before the last patch, the remaining patches do not appear among the patches
// of the next call.
TEST(Cutouts, PatchesCanBeLeftOut) {
  std::mt19937 random(4);
  const Cutouts cutouts = cutouts_of(8, 8, {Wrap::kRepeat, Wrap::kRepeat},
                                     [](uint32_t x, uint32_t y) { return (x + y) % 3 == 0; });
  VisiblePatches patches(kLevels);
  for (int round = 0; round < 20; ++round) {
    const VisiblePart part(random_surface(random, 1), cutouts, kLevels);
    std::vector<FixedTriangle> all;
    const auto add = [&](size_t limit) {
      all.clear();
      return patches.for_each(part, [&](const FixedTriangle& patch) {
        all.push_back(patch);
        return all.size() < limit;
      });
    };
    ASSERT_TRUE(add(SIZE_MAX));
    const size_t count = all.size();
    if (count > 3) {
      EXPECT_FALSE(add(count / 2));
    }
    ASSERT_TRUE(add(SIZE_MAX));
    EXPECT_EQ(all.size(), count);
  }
}

// VisiblePatches collects voxels in blocks of 64^3. A wall across blocks takes few patches (two
// triangles per rectangle of voxels), for a wall in any direction.
TEST(Cutouts, WallsAreFewPatches) {
  constexpr uint32_t kFine = 8;
  constexpr double kSide = 1 << kFine;
  const Cutouts cutouts = cutouts_of(2, 1, {Wrap::kClampToEdge, Wrap::kClampToEdge},
                                     [](uint32_t x, uint32_t) { return x == 0; });
  for (size_t axis = 0; axis < 3; ++axis) {
    double at[3][3];
    for (size_t i = 0; i < 3; ++i) {
      at[i][axis] = 100.5;
      at[i][(axis + 1) % 3] = i == 1 ? 3 * kSide : -kSide;
      at[i][(axis + 2) % 3] = i == 2 ? 3 * kSide : -kSide;
    }
    const FixedSurface surface = surface_of(at, {{0.2, 0}, {0.9, 0}, {0.2, 1}});
    size_t patches = 0;
    VisiblePatches(kFine).for_each(VisiblePart(surface, cutouts, kFine),
                                   [&](const FixedTriangle&) { return ++patches > 0; });
    EXPECT_GE(patches, 16u);
    EXPECT_LE(patches, 32u);
  }
}

TEST(Cutouts, VisibleAndHiddenImages) {
  std::mt19937 random(3);
  for (const bool is_visible : {false, true}) {
    const Cutouts cutouts = cutouts_of(4, 4, {Wrap::kRepeat, Wrap::kRepeat},
                                       [&](uint32_t, uint32_t) { return is_visible; });
    for (int round = 0; round < 20; ++round) {
      const VisiblePart part(random_surface(random, 2), cutouts, kLevels);
      EXPECT_EQ(part.sight(Cube{}), is_visible ? Sight::kVisible : Sight::kHidden);
      EXPECT_EQ(visible_voxels(part), is_visible ? touched_voxels(part.triangle()) : Voxels{});
    }
  }
}

// A visible texel that ends exactly at a border between voxels does not make the voxels beyond the
// border visible. The exception is a voxel that the triangle touches only in one point of that
// border.
TEST(Cutouts, BordersOfTexelsAtBordersOfVoxels) {
  const Cutouts cutouts = cutouts_of(2, 1, {Wrap::kClampToEdge, Wrap::kClampToEdge},
                                     [](uint32_t x, uint32_t) { return x == 0; });
  // The visible texel ends in the middle of the triangle's first edge. There, x is on a border
  // between voxels, as the check below confirms.
  FixedSurface surface =
      surface_of({{0, 0, 8}, {31.9999, 0, 8}, {0, 31.9999, 8}}, {{0, 0}, {1, 0}, {0, 1}});
  ASSERT_EQ(surface.position.v[0][0] + surface.position.v[1][0], 2 * 16 * 256);
  const VisiblePart part(surface, cutouts, kLevels);
  for (const Voxel& voxel : touched_voxels(surface.position))
    EXPECT_EQ(part.is_visible(voxel), voxel[0] < 16 || (voxel[0] == 16 && voxel[1] == 16))
        << voxel[0] << " " << voxel[1];
}

// A triangle that is a point or a segment sets the voxels at which its texels are visible.
TEST(Cutouts, TrianglesWithoutArea) {
  const Cutouts cutouts =
      cutouts_of(2, 1, {Wrap::kRepeat, Wrap::kRepeat}, [](uint32_t x, uint32_t) { return x == 1; });
  const FixedSurface segment = surface_of({{0.5, 3.5, 3.5}, {31.5, 3.5, 3.5}, {31.5, 3.5, 3.5}},
                                          {{0.1, 0.5}, {0.9, 0.5}, {0.9, 0.5}});
  const Voxels voxels = voxels_of_patches(VisiblePart(segment, cutouts, kLevels));
  EXPECT_GE(voxels.size(), 16u);
  EXPECT_LE(voxels.size(), 17u);
  EXPECT_TRUE(voxels.contains({31, 3, 3}));
  EXPECT_FALSE(voxels.contains({0, 3, 3}));
  for (const double u : {0.25, 0.75}) {
    const FixedSurface point = surface_of({{7.5, 3.5, 3.5}, {7.5, 3.5, 3.5}, {7.5, 3.5, 3.5}},
                                          {{u, 0.5}, {u, 0.5}, {u, 0.5}});
    EXPECT_EQ(voxels_of_patches(VisiblePart(point, cutouts, kLevels)).size(), u > 0.5 ? 1u : 0u);
  }
}

// A triangle is hidden if the alpha of its vertex colors is too low for the material's alpha mode,
// even without an image.
TEST(Cutouts, AlphaOfVertices) {
  for (const AlphaMode mode : {AlphaMode::kMask, AlphaMode::kBlend, AlphaMode::kOpaque})
    for (const uint16_t alpha : {0, 1000, 65535}) {
      Cutouts cutouts;
      Material material;
      material.alpha_mode = mode;
      cutouts.materials = {material};
      cutouts.mask_of = {Cutouts::kNoMask};
      FixedSurface surface =
          surface_of({{1, 1, 1}, {9, 1, 1}, {1, 9, 1}}, {{0, 0}, {0, 0}, {0, 0}});
      for (SurfaceCorner& corner : surface.corners) corner.color[3] = alpha;
      const bool is_visible = mode == AlphaMode::kOpaque || alpha == 65535 ||
                              (mode == AlphaMode::kBlend && alpha == 1000);
      EXPECT_EQ(VisiblePart(surface, cutouts, kLevels).sight(Cube{}),
                is_visible ? Sight::kVisible : Sight::kHidden);
    }
}

}  // namespace
}  // namespace voxdag
