// The plane memo: a cache of the nodes of flat surfaces. With it, a cube on a large flat surface
// costs a lookup instead of rasterization. The memo is used for cubes that one triangle covers (see
// Entry in triangle_set.h) and no other triangle touches. There are two kinds of planes:
//
//   small normals    Planes whose |n_a| sum to at most 64, such as walls, floors and slopes of 45
//                    degrees. The nodes for every offset and size of cube are in a hash table.
//                    Keys of the table contain all inputs, so a hit is exact.
//   other planes     The nodes of 8^3 voxels are stored by direction (plane_direction.h), for
//                    triangles that have covered at least kWorthwhile tiles. The nodes of 16^3
//                    voxels are also stored, for directions with kLargeWorthwhile tiles.
//
// For a solid, a node can also contain the inner sides of its plane (InnerSides).
//
// All memory is charged to the budget and kept until the build ends.
// BackendMemory::plane_table_bytes() limits each table. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/backend/cpu/memo/full_nodes.h"
#include "core/backend/cpu/memo/plane.h"
#include "core/backend/cpu/memo/plane_direction.h"
#include "core/backend/cpu/memo/tile_reducer.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class PlaneMemo {
 public:
  PlaneMemo(PooledMemory& memory, SubDagTables& tables, FullNodes& full, TileReducer& reducer,
            const Kernels& kernels, VoxelRule rule)
      : memory_(memory),
        tables_(tables),
        full_(full),
        reducer_(reducer),
        kernels_(kernels),
        rule_(rule) {}

  // The plane of a triangle. `known` is the index of the plane in planes_, or nullopt if planes_
  // does not contain the plane.
  struct Found {
    Plane plane;
    std::optional<uint32_t> known;
  };

  // log2 of the edge of the smallest cube for which build() is worthwhile.
  static constexpr int kSmallestLog2 = 4;

  // Sets `node` to the node of a cube that the triangle `entry` covers and no other triangle
  // touches. If the plane misses the cube, sets node.exists to false. Returns false if the memo
  // does not contain the plane (yet), if Plane::fits() is false for cubes of this size, or if the
  // budget has no memory for the plane's direction.
  bool build(const TriangleSet& triangles, Entry entry, const LatticeCube& cube, int size_log2,
             NodeRef& node);
  // Returns the plane of a triangle that covers a cube; nullopt if build() would return false.
  std::optional<Found> find_plane(const TriangleSet& triangles, Entry entry, int size_log2);
  // Sets `node` to the node of a cube that the plane crosses, with an edge of at most 64 voxels.
  // The node has the voxels that the plane sets and all voxels of its inner sides. `f` is the
  // plane's offset from the cube (plane.h). Sets `filled` to the number of voxels that only the
  // inner sides set. Returns false if the budget has no memory for the plane's direction.
  bool build_tile(const Found& found, InnerSides inner, int64_t f, int size_log2, NodeRef& node,
                  uint64_t& filled);
  // True if build() would succeed for cubes of up to 64^3 voxels that the triangle covers.
  bool has_plane(const TriangleSet& triangles, Entry entry);

 private:
  struct KnownPlane {
    Plane plane;
    bool is_small;
    PlaneDirection* directions[4];  // by InnerSides::bits(); null if not made yet
  };
  struct SmallNode {
    uint64_t key;  // 0: free
    uint64_t hash;
    OctreeCounts counts;
    uint64_t filled;
    uint32_t id;
  };

  // Values of known_:
  //   below kWorthwhile    number of tiles that the triangle has covered so far
  //   kWorthwhile + i      the triangle's plane is planes_[i]
  //   kNever               the memo does not accept the triangle's plane
  static constexpr uint32_t kWorthwhile = 24;
  static constexpr uint32_t kNever = UINT32_MAX;
  // Number of tiles after which a direction gets its nodes of 16^3 voxels.
  static constexpr uint32_t kLargeWorthwhile = 128;

  // Returns the index in planes_ of a triangle's plane; nullopt if the memo does not have the
  // plane. Adds `tiles` to the tiles that the triangle has covered, and adds the plane to the memo
  // when there are kWorthwhile tiles.
  std::optional<uint32_t> find(const TriangleSet& triangles, Entry entry, uint64_t tiles);
  uint32_t add_plane(const Plane& plane);
  PlaneDirection* direction_of(KnownPlane& known, InnerSides inner);
  PlaneDirection* find_direction(const Plane& plane, InnerSides inner);
  bool fits_budget(uint64_t bytes) const;

  NodeRef small_node(const Plane& plane, InnerSides inner, int64_t f, int size_log2);
  NodeRef make_small_node(const Plane& plane, InnerSides inner, int64_t f, int size_log2);
  NodeRef full_node(int size_log2);
  NodeRef node(const Plane& plane, PlaneDirection& direction, int64_t f, int size_log2);
  NodeRef tile_node(PlaneDirection& direction, InnerSides inner, int64_t f, int size_log2);
  template <int kLog2, class NodeAt>
  NodeRef tile_node_of(const PlaneDirection& direction, InnerSides inner, int64_t f, int size_log2,
                       const PlaneNodes<kLog2>& nodes, const NodeAt& node_at);
  void add_large_nodes(PlaneDirection& direction);
  void make_large_node(PlaneDirection& direction, InnerSides inner, int64_t f, PlaneNode& node);
  // Adds the full cubes of 2^from_log2 voxels per edge, on the inner sides of a plane, to the bit
  // set `existing`, which has the cubes that the plane crosses. Adds the nodes and voxels of the
  // full cubes to `counts`. `offsets`: PlaneDirection::offsets(). `count`: number of cubes.
  // `crossed`: range of the offsets at which the plane crosses a cube.
  void add_full(const int64_t* offsets, int count, InnerSides inner, const PlaneRange& crossed,
                int from_log2, uint64_t (&existing)[8], OctreeCounts& counts);
  SmallNode& small_slot(uint64_t key);
  // Makes free slots: enlarges the table or, if the budget does not allow this, clears the table.
  void reserve_small_nodes();

  PooledMemory& memory_;
  SubDagTables& tables_;
  FullNodes& full_;
  TileReducer& reducer_;
  const Kernels& kernels_;
  const VoxelRule rule_;
  // Indexed by the number of a narrow triangle (triangle_set.h). The values are defined above.
  PooledArray<uint32_t> known_;
  PooledArray<KnownPlane> planes_;
  uint32_t plane_count_ = 0;
  std::vector<PooledArray<PlaneDirection>> directions_;
  std::vector<PooledArray<LargePlaneNodes>> large_nodes_;
  PooledArray<SmallNode> small_nodes_;
  uint64_t small_slots_ = 0;  // a power of two
  uint64_t small_count_ = 0;
  uint64_t filled_ = 0;  // voxels that only inner sides set, in all nodes returned so far
};

}  // namespace voxdag::cpu
