// The plain types of the oracle: independent code, as simple as possible, that computes voxdag's
// correct answers. It shares nothing with the checked code, not even constants.
//
// Lengths are in lattice units, 256 to a voxel. Vertices are odd, so they are never on a voxel's
// boundary.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace oracle {

constexpr int64_t kUnits = 256;                      // to a voxel
constexpr int64_t kWidest = (int64_t{1} << 40) - 1;  // largest coordinate a triangle may have

using Point = std::array<int64_t, 3>;  // x, y, z
using Triangle = std::array<Point, 3>;
using Triangles = std::vector<Triangle>;

// A cube of voxels: its low corner and its edge, counted in voxels.
struct Region {
  Point low{0, 0, 0};
  int edge = 0;
};

}  // namespace oracle
