// All nodes of one size that planes of one direction n can produce. A plane with offset f (plane.h)
// passes above or below a voxel corner k, depending on whether f >= -n.k. A cube of e^3 voxels has
// (e + 1)^3 corners, so the sorted values -n.k divide all offsets f into at most (e + 1)^3 + 1
// intervals. All planes with offsets in one interval produce the same node. The same is true for
// nodes that also contain the inner sides of the plane (InnerSides): an inner side only removes one
// end of the range of n.k (PlaneRange::with()). The same intervals are also valid for the rule
// kThin: whether a voxel k is set changes only at the offsets -n.k and -n.(k + u), where u is the
// unit vector along the dominant axis.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>

#include "core/backend/cpu/memo/plane.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

// A node on a plane.
struct PlaneNode {
  uint64_t hash = 0;
  uint32_t id = 0;
  uint32_t voxels : 13 = 0;
  uint32_t filled : 12 = 0;  // number of voxels that only an inner side sets
  uint32_t nodes : 7 = 0;    // number of octree nodes; 0: the node is not made yet

  PlaneNode() = default;
  // A node of at most 16^3 voxels, with the counts of its subtree.
  PlaneNode(const NodeRef& node, const OctreeCounts& counts, uint64_t filled_voxels)
      : hash(node.hash),
        id(node.id),
        voxels(counts.voxels & 0x1fff),
        filled(filled_voxels & 0xfff),
        nodes(counts.nodes & 0x7f) {}
};

// Sets `values` to the sorted values -n.k of the corners k of a cube with an edge of 2^`size_log2`
// voxels, which are (2^size_log2 + 1)^3 values. `other` is memory for as many values.
void sort_corner_values(const int64_t* n, int size_log2, std::span<int64_t> values,
                        std::span<int64_t> other);

// The nodes with an edge of 2^kLog2 voxels. Trivially copyable. Not thread-safe.
template <int kLog2>
class PlaneNodes {
 public:
  static constexpr int kSizeLog2 = kLog2;
  static constexpr int kCorners = ((1 << kLog2) + 1) * ((1 << kLog2) + 1) * ((1 << kLog2) + 1);

  void set_up(const Plane& plane) {
    constexpr int kLast = (1 << kLog2) - 1;  // position of the last voxel along an axis
    min_offset_ = -plane.up - kLast * plane.rising();
    max_offset_ = plane.width - plane.up - kLast * plane.falling();
    int64_t other[kCorners];
    sort_corner_values(plane.n, kLog2, std::span(values_).first(kCorners), other);
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
    std::fill(nodes_, nodes_ + kCorners, PlaneNode{});
  }

  // A plane sets voxels of a node iff its offset f is within [min_offset(), max_offset()].
  int64_t min_offset() const { return min_offset_; }
  int64_t max_offset() const { return max_offset_; }
  // Returns the node of a cube if the plane's offset from this cube is `f`. Requires min_offset()
  // <= f <= max_offset(). The caller makes the node if it is not made yet.
  PlaneNode& at(int64_t f) { return nodes_[interval(f)]; }

 private:
  static constexpr int kBuckets = kLog2 == 3 ? 256 : 2048;

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

  int64_t min_offset_, max_offset_;
  double buckets_per_unit_;
  int64_t values_[kCorners + 1];   // the values -n.k in ascending order, then the largest integer
  uint16_t bucket_[kBuckets + 1];  // index of the last element of values_ that is <= every f in the
                                   // bucket
  PlaneNode nodes_[kCorners];
};

}  // namespace voxdag::cpu
