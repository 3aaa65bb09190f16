#include "tests/oracle/solid/walks.h"

#include <array>
#include <set>
#include <vector>

namespace oracle {
namespace {

using Place = std::array<int, 3>;

// Calls visit(voxel) for the voxels in the grid of the cube with the low corner `cube` and radius +
// 1 voxels per edge.
template <class Visit>
void for_each_voxel(const Place& cube, int radius, int edge, Visit visit) {
  const auto in_grid = [&](int coordinate) { return coordinate >= 0 && coordinate < edge; };
  for (int x = cube[0]; x <= cube[0] + radius; ++x)
    for (int y = cube[1]; in_grid(x) && y <= cube[1] + radius; ++y)
      for (int z = cube[2]; in_grid(y) && z <= cube[2] + radius; ++z)
        if (in_grid(z)) visit(x, y, z);
}

}  // namespace

Voxels enclose(const Voxels& shell, int radius) {
  const int edge = shell.edge(), first = -radius - 1, end = edge + 1;
  const auto is_free = [&](const Place& cube) {
    bool is_empty = true;
    for_each_voxel(cube, radius, edge,
                   [&](int x, int y, int z) { is_empty &= !shell.at(x, y, z); });
    return is_empty;
  };
  const Place start = {first, first, first};
  std::vector<Place> reached = {start};
  std::set<Place> seen = {start};
  for (size_t i = 0; i < reached.size(); ++i)
    for (size_t a = 0; a < 3; ++a)
      for (const int step : {-1, 1}) {
        Place next = reached[i];
        next[a] += step;
        if (next[a] < first || next[a] >= end || !seen.insert(next).second) continue;
        if (is_free(next)) reached.push_back(next);
      }
  Voxels covered(edge), out(edge);
  for (const Place& cube : reached)
    for_each_voxel(cube, radius, edge, [&](int x, int y, int z) { covered.set(x, y, z); });
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z)
        if (!covered.at(x, y, z)) out.set(x, y, z);
  return out;
}

}  // namespace oracle
