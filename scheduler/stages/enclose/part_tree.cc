#include "scheduler/stages/enclose/part_tree.h"

#include <algorithm>

#include "core/geometry/morton.h"

namespace voxdag {
namespace {

uint64_t code_of(const Cube& cube) {
  const uint64_t code = morton_encode(cube.position[0], cube.position[1], cube.position[2]);
  return code << 3 * (kMaxGridLevels - cube.level);
}

}  // namespace

PartTree::PartTree(std::span<const Cube> cubes) {
  std::vector<Placed> placed;
  for (uint32_t i = 0; i < cubes.size(); ++i) placed.push_back({code_of(cubes[i]), i});
  std::ranges::sort(placed, {}, &Placed::code);
  root_ = add({}, placed, cubes);
}

PartTree::Ref PartTree::add(const Cube& cube, std::span<const Placed> placed,
                            std::span<const Cube> cubes) {
  if (placed.empty() || cubes[placed[0].part] == cube) {
    leaves_.push_back({cube, placed.empty() ? kEmpty : placed[0].part});
    return {static_cast<uint32_t>(leaves_.size() - 1), true};
  }
  std::array<Ref, 8> children;
  for (int octant = 0; octant < 8; ++octant) {
    const Cube child = cube.child(octant);
    const uint64_t end = code_of(child) + (uint64_t{1} << 3 * (kMaxGridLevels - child.level));
    const auto rest =
        std::ranges::partition_point(placed, [&](const Placed& p) { return p.code < end; });
    const auto count = static_cast<size_t>(rest - placed.begin());
    children[static_cast<size_t>(octant)] = add(child, placed.first(count), cubes);
    placed = placed.subspan(count);
  }
  nodes_.push_back(children);
  return {static_cast<uint32_t>(nodes_.size() - 1), false};
}

}  // namespace voxdag
