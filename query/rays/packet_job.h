// The data of a packet of rays that are cast together. RayPacket prepares this data, and a walk
// (packet_walk.h) processes it.
//
// The rays of a packet are mirrored: on each axis on which their directions are negative, a
// coordinate c is replaced by R - c, where R is the resolution. So all directions are positive, and
// positions and child masks in this data are mirrored like the rays.
#pragma once

#include <cstdint>

#include "query/dag/dag_view.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {

inline constexpr int kPacketRays = 64;

// A position in voxels, mirrored like the rays. The fourth number has no meaning.
using Int4 = int32_t __attribute__((vector_size(16)));

// A node or brick that a ray can cross. Each ray has a linked list of such cells. It enters a cell
// after it has left all earlier cells of the list without a hit.
struct WaitingCell {
  Int4 low;         // low corner
  uint64_t offset;  // word offset in its level
  uint32_t depth;
  int32_t next;  // next cell of the same ray, or -1
};

// The descent of one ray that has left the packet and continues separately. The descent's path has
// the nodes from the cell in which the descent began to the current cell.
struct RayDescent {
  static constexpr int kMaxLevels = 20;
  Int4 low;  // low corner of the cell that the ray enters next
  uint64_t offset;
  uint32_t depth;
  // Bit d is set if the node at depth d of the path has more children to visit. d is less than
  // `depth`.
  uint32_t open;
  int32_t first_waiting, last_waiting;   // -1 if no cell waits
  uint8_t left[kMaxLevels];              // by depth: mirrored mask of the children to visit
  const uint32_t* children[kMaxLevels];  // by depth: words of the path's node after its mask
};

// A ray's origin, and the inverse of each component of its direction. The fourth number of each
// array has no meaning.
struct alignas(64) PacketRay {
  double origin[4], inverse[4];
};

struct PacketJob {
  static constexpr int kMaxLevels = RayDescent::kMaxLevels;
  struct Level {
    const uint32_t* words;
    uint64_t count;
    uint64_t any_node;  // a node of any size that begins below this offset ends in the level
    bool wide_children;
  };

  // The DAG and its levels. Occupied cells at `leaf_depth`, which is at least 1, count as solid:
  // rays end there.
  const DagView* dag = nullptr;
  Level levels[kMaxLevels];
  uint32_t grid_levels = 0, leaf_depth = 0;

  // The rays of one packet. On each axis, the directions of all rays have the same sign. The bits
  // of `mirror` are the axes on which the rays are mirrored: 4 for x, 2 for y, 1 for z.
  int mirror = 0;
  double t_min = 0, t_max = 0;
  alignas(64) double origin[3][kPacketRays], inverse[3][kPacketRays];
  PacketRay rays[kPacketRays];
  // hits[ray] is the first cell that a ray of `found` hits. If `hits` is null, the walk only finds
  // out which rays have a hit.
  Hit* hits = nullptr;
  uint64_t found = 0;   // bits of the rays with a hit
  uint64_t single = 0;  // bits of the rays that RayCaster must cast

  // Rays that descend separately are collected and then advanced together in a round. A round
  // begins when this number of cells is loading or waiting: the number of cells that memory can
  // load concurrently (measured). Up to one more cell per ray can be added before the round begins.
  static constexpr int kRoundCells = 24, kMaxWaiting = kRoundCells + kPacketRays;
  WaitingCell waiting[kMaxWaiting];
  RayDescent descents[kPacketRays];
};

// Casts the job's rays whose bits are set in `rays`.
void walk_packet_portable(PacketJob& job, uint64_t rays);
using WalkPacket = void (*)(PacketJob& job, uint64_t rays);
// Returns a version of walk_packet_portable() for AVX2, with the same results. Returns null if this
// version was not compiled or this machine cannot run it.
WalkPacket walk_packet_avx2();

}  // namespace voxdag::query
