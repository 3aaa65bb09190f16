// The plane memo: a cache of the nodes of flat surfaces. With it, a cube on a large flat surface
// costs a lookup instead of rasterization. The memo is used for cubes that one triangle covers (see
// Entry in triangle_set.h) and no other triangle touches. There are two kinds of planes:
//
//   small normals    Planes whose |n_a| sum to at most 64, such as walls, floors and slopes of 45
//                    degrees. The nodes for every offset and size of cube are in a hash table.
//                    Keys of the table contain all inputs, so a hit is exact.
//   other planes     The nodes of 8^3 voxels are stored by direction (plane_direction.h), for
//                    triangles that have covered at least kWorthwhile tiles.
//
// All memory is charged to the budget and kept until the build ends.
// BackendMemory::plane_table_bytes() limits each table. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "core/backend/cpu/memo/plane.h"
#include "core/backend/cpu/memo/plane_direction.h"
#include "core/backend/cpu/memo/tile_reducer.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class PlaneMemo {
 public:
  PlaneMemo(PooledMemory& memory, SubDagTables& tables, TileReducer& reducer,
            const Kernels& kernels, VoxelRule rule)
      : memory_(memory), tables_(tables), reducer_(reducer), kernels_(kernels), rule_(rule) {}

  // log2 of the edge of the smallest cube for which build() is worthwhile.
  static constexpr int kSmallestLog2 = 4;

  // Sets `node` to the node of a cube that the triangle `entry` covers and no other triangle
  // touches. If the plane misses the cube, sets node.exists to false. Returns false if the memo
  // does not contain the plane (yet), or if Plane::fits() is false for cubes of this size.
  bool build(const TriangleSet& triangles, Entry entry, const LatticeCube& cube, int size_log2,
             NodeRef& node);
  // True if build() would succeed for cubes of up to 64^3 voxels that the triangle covers.
  bool has_plane(const TriangleSet& triangles, Entry entry);

 private:
  struct KnownPlane {
    Plane plane;
    PlaneDirection* direction;  // null for a small normal
  };
  struct SmallNode {
    uint64_t key;  // 0: free
    uint64_t hash;
    OctreeCounts counts;
    uint32_t id;
  };

  // Values of known_:
  //   below kWorthwhile    number of tiles that the triangle has covered so far
  //   kWorthwhile + i      the triangle's plane is planes_[i]
  //   kNever               the memo does not accept the triangle's plane
  static constexpr uint32_t kWorthwhile = 24;
  static constexpr uint32_t kNever = UINT32_MAX;

  const KnownPlane* find(const TriangleSet& triangles, Entry entry, uint64_t tiles);
  uint32_t add_plane(const Plane& plane);
  PlaneDirection* direction_of(const Plane& plane);
  bool fits_budget(uint64_t bytes) const;

  NodeRef small_node(const Plane& plane, int64_t f, int size_log2);
  NodeRef make_small_node(const Plane& plane, int64_t f, int size_log2);
  NodeRef node(const Plane& plane, PlaneDirection& direction, int64_t f, int size_log2);
  NodeRef tile_node(PlaneDirection& direction, int64_t f, int size_log2);
  SmallNode& small_slot(uint64_t key);
  // Makes free slots: enlarges the table or, if the budget does not allow this, clears the table.
  void reserve_small_nodes();

  PooledMemory& memory_;
  SubDagTables& tables_;
  TileReducer& reducer_;
  const Kernels& kernels_;
  const VoxelRule rule_;
  PooledArray<uint32_t> known_;  // by number of the narrow triangle
  PooledArray<KnownPlane> planes_;
  uint32_t plane_count_ = 0;
  std::vector<PooledArray<PlaneDirection>> directions_;
  PooledArray<SmallNode> small_nodes_;
  uint64_t small_slots_ = 0;  // a power of two
  uint64_t small_count_ = 0;
};

}  // namespace voxdag::cpu
