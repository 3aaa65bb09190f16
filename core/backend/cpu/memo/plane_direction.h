// The nodes that planes of one direction can produce, in two sizes (plane_nodes.h). The nodes of
// 16^3 voxels are worthwhile only for directions with many tiles, so they are in a separate object.
#pragma once

#include <cstdint>

#include "core/backend/cpu/memo/plane.h"
#include "core/backend/cpu/memo/plane_nodes.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

using SmallPlaneNodes = PlaneNodes<3>;
using LargePlaneNodes = PlaneNodes<4>;

// Plane::fractional must be true for the planes. Trivially copyable, at most 24 KiB. Not
// thread-safe.
class PlaneDirection {
 public:
  void set_up(const Plane& plane, InnerSides inner);
  bool is_direction_of(const Plane& plane, InnerSides inner) const {
    return plane_.n[0] == plane.n[0] && plane_.n[1] == plane.n[1] && plane_.n[2] == plane.n[2] &&
           inner_ == inner;
  }

  // Returns a plane of this direction, with an arbitrary offset.
  const Plane& plane() const { return plane_; }
  // Returns the values of n.k for the 512 voxels k of a cube of 8^3, in Morton order, where n is
  // the direction. The same values, multiplied by 2^s, are n.k for the low corners k of smaller
  // cubes in a cube. The edge of the smaller cubes is 2^s voxels.
  const int64_t* offsets() const { return offsets_; }

  const SmallPlaneNodes& small() const { return small_; }
  // Returns the node of a cube of 8^3 voxels, as PlaneNodes::at() does. Makes it if necessary.
  const PlaneNode& small_node(int64_t f, SubDagTables& tables, const Kernels& kernels) {
    PlaneNode& node = small_.at(f);
    if (node.nodes == 0) make(f, tables, kernels, node);
    return node;
  }

  // Returns the nodes of 16^3 voxels; null before set_large().
  LargePlaneNodes* large() const { return large_; }
  void set_large(LargePlaneNodes* large) { large_ = large; }
  // Counts a tile of this direction. Returns the number of tiles so far.
  uint32_t add_tile() { return ++tiles_; }

 private:
  void make(int64_t f, SubDagTables& tables, const Kernels& kernels, PlaneNode& node) const;

  Plane plane_;
  InnerSides inner_;
  uint32_t tiles_;
  LargePlaneNodes* large_;
  int64_t offsets_[512];
  SmallPlaneNodes small_;
};
static_assert(sizeof(PlaneDirection) <= 24 << 10);

}  // namespace voxdag::cpu
