#include "scheduler/stages/rows/empty_cubes.h"

#include <set>

namespace voxdag {

std::vector<Cube> maximal_empty_cubes(std::span<const Cube> occupied) {
  if (occupied.empty()) return {Cube{}};
  std::set<Cube> inner, known(occupied.begin(), occupied.end());
  for (Cube cube : occupied)
    while (cube.level > 0 && inner.insert(cube.parent()).second) cube = cube.parent();
  known.insert(inner.begin(), inner.end());
  std::vector<Cube> empty;
  for (const Cube& cube : inner)
    for (int c = 0; c < 8; ++c)
      if (!known.contains(cube.child(c))) empty.push_back(cube.child(c));
  return empty;
}

}  // namespace voxdag
