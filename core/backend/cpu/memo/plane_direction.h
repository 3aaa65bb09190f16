// All nodes of 8^3 voxels that planes of one direction n can produce. A plane with offset f
// (plane.h) passes above or below a voxel corner k, depending on whether f >= -n.k. A cube of 8^3
// voxels has 729 corners, so the sorted values -n.k divide all offsets f into at most 730
// intervals. All planes with offsets in one interval produce the same node. This node is made once
// and then looked up. The same is true for nodes that also contain the inner sides of the plane
// (InnerSides): an inner side only removes one end of the range of n.k (PlaneRange::with()). The
// same intervals are also valid for the rule kThin: whether a voxel k is set changes only at the
// offsets -n.k and -n.(k + e), where e is the unit vector along the dominant axis.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/plane.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

// The nodes of one direction of planes. Plane::fractional must be true for the planes. Trivially
// copyable, at most 24 KiB. Not thread-safe.
class PlaneDirection {
 public:
  static constexpr int kSizeLog2 = 3;  // log2 of the edge of the nodes' cubes, in voxels
  static constexpr int kCorners = 9 * 9 * 9;

  // A node of 8^3 voxels, the number of its voxels, the number of voxels that only an inner side
  // sets (`filled`), and the number of its octree nodes.
  struct Known {
    uint64_t hash;
    uint32_t id;
    uint32_t voxels : 10;
    uint32_t filled : 10;
    uint32_t nodes : 4;  // 0: the node is not made yet
  };

  void set_up(const Plane& plane, InnerSides inner);
  bool is_direction_of(const Plane& plane, InnerSides inner) const {
    return n_[0] == plane.n[0] && n_[1] == plane.n[1] && n_[2] == plane.n[2] && inner_ == inner;
  }

  // Returns the values of n.k for the 512 voxels k of a node, in Morton order, where n is the
  // direction. The same values, multiplied by 8, are n.k for the low corners k of the 512 nodes in
  // a tile of 64^3 voxels.
  const int64_t* offsets() const { return offsets_; }
  // A plane sets voxels of a node iff its offset f is within [min_offset(), max_offset()].
  int64_t min_offset() const { return min_offset_; }
  int64_t max_offset() const { return max_offset_; }

  // Returns the node of a cube of 8^3 voxels if the plane's offset from this cube is `f`. Requires
  // min_offset() <= f <= max_offset().
  const Known& node(int64_t f, SubDagTables& tables, const Kernels& kernels) {
    Known& known = known_[interval(f)];
    if (known.nodes == 0) make(f, tables, kernels, known);
    return known;
  }

 private:
  static constexpr int kBuckets = 256;

  // Returns the index of the last element of values_ that is <= f.
  int interval(int64_t f) const {
    int i = bucket_[bucket(f)];
    while (values_[i + 1] <= f) ++i;
    return i;
  }
  // Returns the bucket of an offset f. The bucket never decreases if f increases. The rounding of
  // the doubles does not matter, because bucket_ was made with this function.
  int bucket(int64_t f) const {
    return static_cast<int>(static_cast<double>(f - values_[0]) * buckets_per_unit_);
  }
  void make(int64_t f, SubDagTables& tables, const Kernels& kernels, Known& known) const;

  int64_t n_[3];
  int64_t up_, width_;
  InnerSides inner_;
  int64_t min_offset_, max_offset_;
  double buckets_per_unit_;
  int64_t values_[kCorners + 1];  // the values -n.k in ascending order, then the largest integer
  int64_t offsets_[512];
  uint16_t bucket_[kBuckets + 1];  // index of the last element of values_ that is <= every f in the
                                   // bucket
  Known known_[kCorners];
};
static_assert(sizeof(PlaneDirection) <= 24 << 10);

}  // namespace voxdag::cpu
