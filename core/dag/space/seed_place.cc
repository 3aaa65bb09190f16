#include "core/dag/space/seed_place.h"

#include <vector>

namespace voxdag {

SeedPlace find_seed(const SpaceLabels& labels, const CubeVoxel& voxel) {
  const NodeLevels& levels = labels.levels();
  const int bricks = levels.brick_depth();
  const auto octant = [&](int depth) { return octant_around(voxel, bricks, depth); };
  std::vector<uint32_t> rows = {0};  // the nodes around the voxel, by depth
  int depth = 0;
  for (; depth < bricks && levels.has_child(depth, rows.back(), octant(depth)); ++depth)
    rows.push_back(levels.child(depth, rows.back(), octant(depth)));
  // Number of the voxel's component in the octant around the voxel. This is an octant of the node
  // rows[depth]. An empty octant has one component.
  uint32_t component = 0;
  if (depth == bricks) {
    const uint64_t bit = uint64_t{1} << bit_in_brick(voxel);
    const uint64_t empty = ~levels.bricks[rows.back()];
    if ((bit & empty) == 0) return {};
    if (brick_touch(brick_flood(bit, empty)) == 0) return {SeedPlace::Kind::kClosed, bricks, 0};
    const uint64_t* const components = labels.brick_components(rows.back());
    while ((components[component] & bit) == 0) ++component;
    --depth;
  }
  for (; depth >= 0; --depth) {
    const uint32_t row = rows[static_cast<size_t>(depth)];
    const uint16_t label = labels.labels_of_octant(depth, row, octant(depth))[component];
    if (label == SpaceLabels::kClosed) return {SeedPlace::Kind::kClosed, depth, component};
    component = label;
  }
  return {SeedPlace::Kind::kOpen, 0, component};
}

}  // namespace voxdag
