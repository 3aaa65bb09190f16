// Surfaces for tests: triangles of the oracle's scenes, with materials and texture coordinates made
// from a seed.
#pragma once

#include <cstdint>
#include <vector>

#include "core/color/rule/bake_region.h"
#include "tests/oracle/scenes.h"
#include "tests/unit/core/color/images.h"

namespace voxdag {

inline FixedTriangle fixed(const oracle::Triangle& triangle) {
  FixedTriangle out;
  for (size_t i = 0; i < 3; ++i)
    for (size_t a = 0; a < 3; ++a) out.v[i][a] = triangle[i][a];
  return out;
}
inline oracle::Triangle plain(const FixedTriangle& triangle) {
  oracle::Triangle out;
  for (size_t i = 0; i < 3; ++i)
    for (size_t a = 0; a < 3; ++a) out[i][a] = triangle.v[i][a];
  return out;
}

// Materials of every kind: with and without an image, with all alpha modes and wrap modes.
struct TestLooks {
  TestImages images;
  std::vector<Material> materials;

  TestLooks() {
    images.add(64, 64, 1);
    images.add(37, 20, 2);
    for (uint32_t i = 0; i < 9; ++i) {
      Material m;
      m.image = i % 3 == 2 ? Material::kNoImage : i % 3;
      m.alpha_mode = static_cast<AlphaMode>(i / 3);
      m.alpha_cutoff = 30000;
      m.wrap = {static_cast<Wrap>(i % 3), static_cast<Wrap>((i + i / 3) % 3)};
      m.factor = {65535, static_cast<uint16_t>(50000 + i), 65535, static_cast<uint16_t>(65535 - i)};
      materials.push_back(m);
    }
  }

  // Returns a surface with a random material, texture coordinates and vertex colors for each
  // triangle. `widest` is the largest texture coordinate, in units of 2^-24 of the image's size.
  std::vector<FixedSurface> surfaces(const oracle::Triangles& triangles, uint64_t seed,
                                     int64_t widest = int64_t{3} << kTextureBits) const {
    oracle::Random random(seed);
    std::vector<FixedSurface> out;
    for (const oracle::Triangle& triangle : triangles) {
      FixedSurface s;
      s.position = fixed(triangle);
      s.material = static_cast<uint32_t>(random.between(0, 8));
      const bool one_color = random.coin();
      for (SurfaceCorner& corner : s.corners) {
        for (int64_t& t : corner.texture) t = random.between(-widest, widest);
        for (uint16_t& c : corner.color) c = static_cast<uint16_t>(random.between(0, 65535));
        if (one_color) corner.color = s.corners[0].color;
      }
      out.push_back(s);
    }
    return out;
  }
};

inline std::vector<ColoredCell> bake(const ColorGrid& grid, const Cube& region,
                                     const std::vector<FixedSurface>& surfaces,
                                     const TestLooks& looks) {
  std::vector<ColoredCell> cells;
  bake_region(grid, region, surfaces, looks.materials, looks.images, cells);
  return cells;
}

}  // namespace voxdag
