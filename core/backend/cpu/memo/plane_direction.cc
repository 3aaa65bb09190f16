#include "core/backend/cpu/memo/plane_direction.h"

#include "core/dag/node_hash.h"

namespace voxdag::cpu {

void PlaneDirection::set_up(const Plane& plane, InnerSides inner) {
  plane_ = plane;
  inner_ = inner;
  tiles_ = 0;
  large_ = nullptr;
  small_.set_up(plane);
  for (int m = 0; m < 512; ++m) {
    int64_t k[3];
    for (int a = 0; a < 3; ++a) k[a] = brick_coordinate(m, a) | (m >> (8 - a) & 1) << 2;
    offsets_[m] = plane.n[0] * k[0] + plane.n[1] * k[1] + plane.n[2] * k[2];
  }
}

void PlaneDirection::make(int64_t f, SubDagTables& tables, const Kernels& kernels,
                          PlaneNode& node) const {
  const OctreeCounts before = tables.counts();
  const PlaneRange crossed(plane_.up, plane_.width, f), set = crossed.with(inner_);
  uint64_t masks[8], shell[8];
  kernels.find_in_range(offsets_, 512, crossed.low, crossed.high, shell);
  kernels.find_in_range(offsets_, 512, set.low, set.high, masks);
  NodeRef bricks[8];
  uint64_t filled = 0;
  for (int c = 0; c < 8; ++c) {
    bricks[c] = tables.add_brick(masks[c]);
    filled += static_cast<uint64_t>(popcount64(masks[c] & ~shell[c]));
  }
  const NodeRef made = tables.add_node(SmallPlaneNodes::kSizeLog2, bricks);
  node = PlaneNode(made, tables.counts() - before, filled);
  tables.counts() = before;
}

}  // namespace voxdag::cpu
