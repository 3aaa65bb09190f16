// Helpers for the tests that draw triangles: tiles at any position of the largest grid, and their
// voxels.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/backend/cpu/raster/kernels.h"
#include "core/geometry/morton.h"
#include "tests/oracle/core_types.h"
#include "tests/oracle/scenes.h"
#include "tests/oracle/voxels.h"

namespace voxdag::cpu {

// A triangle of the oracle in the form that this backend uses: coordinates by axis. An unused
// triangle follows it, because kernels load four coordinates instead of three.
template <class Coordinate>
struct Padded {
  explicit Padded(const oracle::Triangle& t) {
    const WideTriangle wide = axis_major(oracle::fixed(t));
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < 3; ++i) triangle.v[a][i] = static_cast<Coordinate>(wide.v[a][i]);
  }
  Triangle<Coordinate> triangle;
  Triangle<Coordinate> spare{};
};

// Returns all kernels that this machine can run.
inline std::vector<const Kernels*> all_kernels() {
  std::vector<const Kernels*> all = {&portable_kernels()};
  for (const Kernels* kernels : {avx2_kernels(), avx512_kernels()})
    if (kernels) all.push_back(kernels);
  return all;
}

inline bool is_narrow(const oracle::Triangle& t) { return is_narrow(axis_major(oracle::fixed(t))); }

inline LatticeCube box_of(const oracle::Region& region) {
  LatticeCube box;
  for (int a = 0; a < 3; ++a) box.low[a] = region.low[a] * kUnitsPerVoxel;
  box.edge = region.edge * kUnitsPerVoxel;
  return box;
}

// Returns an aligned cube of 2^size_log2 voxels per edge in a grid of 2^20 voxels per edge.
inline oracle::Region random_region(oracle::Random& random, int size_log2) {
  oracle::Region region;
  region.edge = 1 << size_log2;
  for (int64_t& low : region.low)
    low = random.between(0, (int64_t{1} << (20 - size_log2)) - 1) << size_log2;
  return region;
}

inline oracle::Voxels voxels_of(TileBricks& tile, int edge) {
  oracle::Voxels voxels(edge);
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z) {
        const uint64_t code = morton_encode(x, y, z);
        if (tile.brick(static_cast<uint32_t>(code / 64)) >> code % 64 & 1) voxels.set(x, y, z);
      }
  return voxels;
}

// Draws a triangle into an empty tile, and returns the tile's voxels. `Prepared` is the class that
// prepares the triangle for `draw`: TileTriangle, or ThinTriangle for the rule kThin.
template <template <class> class Prepared = TileTriangle, class Coordinate, class Draw>
oracle::Voxels drawn(const Triangle<Coordinate>& triangle, bool inside,
                     const oracle::Region& region, Draw draw) {
  const auto tile = std::make_unique<TileBricks>();
  Prepared<Coordinate> in_tile;
  if (in_tile.set_up(triangle, inside, box_of(region))) draw(in_tile, *tile);
  return voxels_of(*tile, region.edge);
}

}  // namespace voxdag::cpu
