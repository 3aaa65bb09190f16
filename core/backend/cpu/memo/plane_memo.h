// The memo of planes. With it, large flat surfaces cost a lookup per cube instead of rasterization.
// It is used for cubes that a single triangle covers.
//
//   small normals    (walls, floors, 45 degrees) The nodes for every offset and size of cube, in a
//                    hash table. Its keys contain all inputs, so a hit is exact.
//   other planes     The nodes of 8^3 voxels by direction (plane_direction.h), for triangles that
//                    have covered enough tiles.
//
// All memory is charged to the budget, is at most an eighth of it, and is kept until the build
// ends. Not thread-safe.
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
            const Kernels& kernels)
      : memory_(memory), tables_(tables), reducer_(reducer), kernels_(kernels) {}

  // log2 of the edge of the smallest cube for which build() is worthwhile.
  static constexpr int kSmallestLog2 = 4;

  // Sets `node` to the node of a cube that one triangle covers and no other triangle touches.
  // Returns false if the plane is not in the memo (yet), or not for cubes of this size.
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

  // Meaning of the values in known_: below kWorthwhile, the number of tiles that the triangle has
  // covered so far; from kWorthwhile, kWorthwhile plus the number of the triangle's plane; or
  // kNever.
  static constexpr uint32_t kWorthwhile = 24;  // tiles
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
  // Makes free slots by growing, or by clearing the table.
  void reserve_small_nodes();

  PooledMemory& memory_;
  SubDagTables& tables_;
  TileReducer& reducer_;
  const Kernels& kernels_;
  PooledArray<uint32_t> known_;  // by triangle, narrow ones first
  PooledArray<KnownPlane> planes_;
  uint32_t plane_count_ = 0;
  std::vector<PooledArray<PlaneDirection>> directions_;
  PooledArray<SmallNode> small_nodes_;
  uint64_t small_slots_ = 0;  // a power of two
  uint64_t small_count_ = 0;
};

}  // namespace voxdag::cpu
