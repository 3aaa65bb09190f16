#include "tests/oracle/grid.h"

#include <algorithm>
#include <cmath>

namespace oracle {
namespace {

// Returns the lowest and the highest coordinate of all vertices on one axis.
std::pair<double, double> extent(const std::vector<WorldTriangle>& triangles, int axis) {
  std::vector<double> all;
  for (const WorldTriangle& t : triangles)
    for (const WorldPoint& p : t) all.push_back(p[axis]);
  const auto [low, high] = std::minmax_element(all.begin(), all.end());
  return {*low, *high};
}

WorldCube centered(const std::vector<WorldTriangle>& triangles, double edge) {
  WorldCube cube;
  cube.edge = edge;
  for (int a = 0; a < 3; ++a) {
    const auto [low, high] = extent(triangles, a);
    cube.origin[a] = 0.5 * (low + high) - 0.5 * edge;
  }
  return cube;
}

}  // namespace

WorldCube default_cube(const std::vector<WorldTriangle>& triangles) {
  double longest = 0;
  for (int a = 0; a < 3; ++a) {
    const auto [low, high] = extent(triangles, a);
    longest = std::max(longest, high - low);
  }
  return centered(triangles, longest == 0 ? 1 : longest * (1 + 1 / 32768.0));
}

WorldCube cube_of_voxel_size(const std::vector<WorldTriangle>& triangles, double voxel_size,
                             int64_t resolution) {
  return centered(triangles, voxel_size * static_cast<double>(resolution));
}

Triangles snap(const std::vector<WorldTriangle>& triangles, const WorldCube& cube,
               int64_t resolution) {
  Triangles out;
  for (const WorldTriangle& world : triangles) {
    Triangle t;
    bool misses = false;
    for (int a = 0; a < 3; ++a) {
      for (int i = 0; i < 3; ++i) {
        const double x =
            (world[i][a] - cube.origin[a]) / cube.edge * static_cast<double>(resolution);
        t[i][a] = 2 * static_cast<int64_t>(std::floor(128 * x)) + 1;
      }
      misses |= t[0][a] < 0 && t[1][a] < 0 && t[2][a] < 0;
      const int64_t end = resolution * kUnits;
      misses |= t[0][a] > end && t[1][a] > end && t[2][a] > end;
    }
    if (!misses) out.push_back(t);
  }
  return out;
}

}  // namespace oracle
