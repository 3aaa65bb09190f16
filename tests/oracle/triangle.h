// The plain types of the oracle. The oracle is independent code, as simple as possible, that
// computes the correct answers for voxdag's tests. It shares nothing with the tested code, not even
// constants.
//
// Lengths are in lattice units, 256 per voxel. Vertices have odd coordinates, so they are never on
// the boundary of a voxel.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace oracle {

constexpr int64_t kUnits = 256;                      // lattice units per voxel
constexpr int64_t kWidest = (int64_t{1} << 40) - 1;  // largest coordinate of a triangle

using Point = std::array<int64_t, 3>;  // x, y, z
using Triangle = std::array<Point, 3>;
using Triangles = std::vector<Triangle>;

// A cube of voxels: its low corner and its edge, in voxels.
struct Region {
  Point low{0, 0, 0};
  int edge = 0;
};

}  // namespace oracle
