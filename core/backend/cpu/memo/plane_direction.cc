#include "core/backend/cpu/memo/plane_direction.h"

#include <algorithm>
#include <limits>

#include "core/dag/node_hash.h"

namespace voxdag::cpu {

void PlaneDirection::set_up(const Plane& plane, InnerSides inner) {
  inner_ = inner;
  std::copy(plane.n, plane.n + 3, n_);
  up_ = plane.up;
  width_ = plane.width;
  min_offset_ = -up_ - 7 * plane.rising();
  max_offset_ = width_ - up_ - 7 * plane.falling();
  int count = 0;
  for (int z = 0; z <= 8; ++z)
    for (int y = 0; y <= 8; ++y)
      for (int x = 0; x <= 8; ++x) values_[count++] = -(n_[0] * x + n_[1] * y + n_[2] * z);
  std::sort(values_, values_ + kCorners);
  values_[kCorners] = std::numeric_limits<int64_t>::max();
  const int64_t span = values_[kCorners - 1] - values_[0];
  buckets_per_unit_ = kBuckets / (static_cast<double>(span) + 1.0);
  int i = 0;
  for (int b = 0; b <= kBuckets; ++b) {
    // Sets i to the index of the first value in bucket b or a later bucket. The value at i - 1 is
    // in an earlier bucket, so it is less than every offset f in bucket b. The value at i can be
    // greater than an offset in bucket b.
    while (i < kCorners && bucket(values_[i]) < b) ++i;
    bucket_[b] = static_cast<uint16_t>(std::max(i - 1, 0));
  }
  for (int m = 0; m < 512; ++m) {
    int64_t k[3];
    for (int a = 0; a < 3; ++a) k[a] = brick_coordinate(m, a) | (m >> (8 - a) & 1) << 2;
    offsets_[m] = n_[0] * k[0] + n_[1] * k[1] + n_[2] * k[2];
  }
  std::fill(known_, known_ + kCorners, Known{});
}

void PlaneDirection::make(int64_t f, SubDagTables& tables, const Kernels& kernels,
                          Known& known) const {
  const OctreeCounts before = tables.counts();
  const PlaneRange crossed(up_, width_, f), set = crossed.with(inner_);
  uint64_t masks[8], shell[8];
  kernels.find_in_range(offsets_, 512, crossed.low, crossed.high, shell);
  kernels.find_in_range(offsets_, 512, set.low, set.high, masks);
  NodeRef bricks[8];
  uint32_t filled = 0;
  for (int c = 0; c < 8; ++c) {
    bricks[c] = tables.add_brick(masks[c]);
    filled += static_cast<uint32_t>(popcount64(masks[c] & ~shell[c]));
  }
  const NodeRef node = tables.add_node(kSizeLog2, bricks);
  const OctreeCounts counts = tables.counts() - before;
  tables.counts() = before;
  known.hash = node.hash;
  known.id = node.id;
  known.voxels = static_cast<uint32_t>(counts.voxels) & 0x3ff;
  known.filled = filled & 0x3ff;
  known.nodes = static_cast<uint32_t>(counts.nodes) & 0xf;
}

}  // namespace voxdag::cpu
