// What a build remembers of planes, so that large flat surfaces cost a lookup per cube and not a
// raster: the answer is used for cubes that a single triangle covers.
//
//   small normals    (walls, floors, 45 degrees) the node of every offset and size of cube, in a
//                    hash table whose keys are the whole question, so compared exactly
//   other planes     the nodes of 8 voxels by direction (plane_direction.h), once a triangle has
//                    been seen to cover enough tiles to be worth it
//
// All of it is charged to the budget, takes an eighth of it at most, and goes with the build.
#pragma once

#include <cstdint>
#include <vector>

#include "core/backend/cpu/kernels.h"
#include "core/backend/cpu/memo/plane.h"
#include "core/backend/cpu/memo/plane_direction.h"
#include "core/backend/cpu/tables/sub_dag_tables.h"
#include "core/backend/cpu/tables/tile_reducer.h"

namespace voxdag::cpu {

class PlaneMemo {
 public:
  PlaneMemo(Memory& memory, SubDagTables& tables, TileReducer& reducer, const Kernels& kernels)
      : memory_(memory), tables_(tables), reducer_(reducer), kernels_(kernels) {}

  // The smallest cube that is worth asking for.
  static constexpr int kSmallestLog2 = 4;

  // Makes `node` that of a cube which one triangle, covering it, and nothing else touches. False
  // if its plane is not remembered (yet) or the cube has a size that it is not remembered for.
  bool build(const TriangleSet& triangles, Entry entry, const Box& cube, int size_log2,
             NodeRef& node);
  // Whether build() would succeed for cubes of up to 64 voxels that the triangle covers.
  bool remembers(const TriangleSet& triangles, Entry entry);

 private:
  struct Remembered {
    Plane plane;
    PlaneDirection* direction;  // null: a small normal
  };
  struct Memo {
    uint64_t key;  // 0: free
    uint64_t hash;
    OctreeCounts counts;
    uint32_t id;
  };

  // What is known of a triangle: how many tiles it was seen to cover, or its plane's number.
  static constexpr uint32_t kWorthwhile = 24;  // tiles
  static constexpr uint32_t kNever = UINT32_MAX;

  const Remembered* find(const TriangleSet& triangles, Entry entry, uint64_t tiles);
  uint32_t remember(const Plane& plane);
  PlaneDirection* direction_of(const Plane& plane);
  bool affordable(uint64_t bytes) const;

  NodeRef small_node(const Plane& plane, int64_t f, int size_log2);
  NodeRef make_small_node(const Plane& plane, int64_t f, int size_log2);
  NodeRef node(const Plane& plane, PlaneDirection& direction, int64_t f, int size_log2);
  NodeRef tile_node(PlaneDirection& direction, int64_t f, int size_log2);
  Memo& memo_slot(uint64_t key);
  // Makes room, or forgets everything.
  void reserve_memo();

  Memory& memory_;
  SubDagTables& tables_;
  TileReducer& reducer_;
  const Kernels& kernels_;
  Buffer<uint32_t> known_;  // by triangle, narrow ones first
  Buffer<Remembered> planes_;
  uint32_t plane_count_ = 0;
  std::vector<Buffer<PlaneDirection>> directions_;
  Buffer<Memo> memo_;
  uint64_t memo_slots_ = 0;  // a power of two
  uint64_t memo_count_ = 0;
};

}  // namespace voxdag::cpu
