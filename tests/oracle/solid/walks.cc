#include "tests/oracle/solid/walks.h"

#include <array>
#include <set>
#include <vector>

namespace oracle {
namespace {

using Place = std::array<int, 3>;

// Calls visit(voxel) for each voxel of a cube that is inside the grid. `cube` is the low corner of
// the cube, which has radius + 1 voxels per edge.
template <class Visit>
void for_each_voxel(const Place& cube, int radius, int edge, Visit visit) {
  const auto in_grid = [&](int coordinate) { return coordinate >= 0 && coordinate < edge; };
  for (int x = cube[0]; x <= cube[0] + radius; ++x)
    for (int y = cube[1]; in_grid(x) && y <= cube[1] + radius; ++y)
      for (int z = cube[2]; in_grid(y) && z <= cube[2] + radius; ++z)
        if (in_grid(z)) visit(x, y, z);
}

// All positions at which a cube of radius + 1 voxels per edge overlaps the grid, and one more
// position on each side. A position is the cube's voxel with the lowest coordinates.
struct Walks {
  const Voxels& shell;
  int radius;
  int edge = shell.edge(), first = -radius - 1, end = edge + 1;

  bool is_free(const Place& cube) const {
    bool is_empty = true;
    for_each_voxel(cube, radius, edge,
                   [&](int x, int y, int z) { is_empty &= !shell.at(x, y, z); });
    return is_empty;
  }
  // Returns the free positions that are reached from `start`.
  std::set<Place> reached_from(const Place& start) const {
    std::vector<Place> reached = {start};
    std::set<Place> seen = {start}, free = {start};
    for (size_t i = 0; i < reached.size(); ++i)
      for (size_t a = 0; a < 3; ++a)
        for (const int step : {-1, 1}) {
          Place next = reached[i];
          next[a] += step;
          if (next[a] < first || next[a] >= end || !seen.insert(next).second) continue;
          if (!is_free(next)) continue;
          reached.push_back(next);
          free.insert(next);
        }
    return free;
  }
  // Returns the voxels that no cube at an open position covers. A position is open if is_open() is
  // true for it.
  template <class IsOpen>
  Voxels uncovered(const IsOpen& is_open) const {
    Voxels covered(edge), out(edge);
    for (int x = first; x < end; ++x)
      for (int y = first; y < end; ++y)
        for (int z = first; z < end; ++z)
          if (is_open({x, y, z}))
            for_each_voxel({x, y, z}, radius, edge,
                           [&](int i, int j, int k) { covered.set(i, j, k); });
    for (int x = 0; x < edge; ++x)
      for (int y = 0; y < edge; ++y)
        for (int z = 0; z < edge; ++z)
          if (!covered.at(x, y, z)) out.set(x, y, z);
    return out;
  }
};

}  // namespace

Voxels enclose(const Voxels& shell, int radius) {
  const Walks walks{shell, radius};
  const std::set<Place> open = walks.reached_from({walks.first, walks.first, walks.first});
  return walks.uncovered([&](const Place& cube) { return open.contains(cube); });
}

std::optional<SeededSolid> enclose_seed(const Voxels& shell, int radius,
                                        const std::array<int, 3>& seed) {
  const Walks walks{shell, radius};
  Place start = seed;
  for (int& coordinate : start) coordinate -= radius / 2;
  if (!walks.is_free(start)) return std::nullopt;
  std::set<Place> reached = walks.reached_from(start);
  const bool is_enclosed = !reached.contains({walks.first, walks.first, walks.first});
  if (!is_enclosed) reached.clear();
  return SeededSolid{walks.uncovered([&](const Place& cube) {
                       return walks.is_free(cube) && !reached.contains(cube);
                     }),
                     is_enclosed};
}

}  // namespace oracle
