// The data of a packet of rays that is being cast, and the descent of each ray. RayPacket prepares
// this data, and a walk (packet_walk.h) processes it.
#pragma once

#include <cstdint>

#include "query/dag/dag_view.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {

inline constexpr int kPacketRays = 64;

// A position in voxels, mirrored like the rays. The fourth number has no meaning.
using Int4 = int32_t __attribute__((vector_size(16)));

// A node or brick that a ray may cross. The ray enters this cell after it has left all earlier
// cells of its list without a hit.
struct WaitingCell {
  Int4 low;         // low corner
  uint64_t offset;  // word offset in its level
  uint32_t depth;
  int32_t next;  // next cell of the same ray, or -1
};

// The descent of one ray.
struct RayDescent {
  static constexpr int kMaxLevels = 20;
  Int4 low;  // low corner of the cell that the ray enters next
  uint64_t offset;
  uint32_t depth;
  // Bit d is set if the node at depth d of the path has more children to visit. d is less than
  // `depth`.
  uint32_t open;
  int32_t first_waiting, last_waiting;   // -1 if no cell waits
  uint8_t left[kMaxLevels];              // children still to be visited, mirrored; by depth
  const uint32_t* children[kMaxLevels];  // words after the mask of the path's nodes; by depth
};

// A ray's origin and the inverse of its direction. The fourth number of each has no meaning.
struct alignas(64) PacketRay {
  double origin[4], inverse[4];
};

struct PacketJob {
  static constexpr int kMaxLevels = RayDescent::kMaxLevels;
  struct Level {
    const uint32_t* words;
    uint64_t count;
    uint64_t any_node;  // below this offset, even the largest node fits in the level
    bool wide_children;
  };

  // The DAG, and its grid. Cells at `leaf_depth`, which is at least 1, count as solid.
  const DagView* dag = nullptr;
  Level levels[kMaxLevels];
  uint32_t grid_levels = 0, leaf_depth = 0;

  // The rays. The signs of their directions are equal, and the rays are mirrored so that the
  // directions are positive.
  int mirror = 0;
  double t_min = 0, t_max = 0;
  alignas(64) double origin[3][kPacketRays], inverse[3][kPacketRays];
  PacketRay rays[kPacketRays];
  Hit* hits = nullptr;
  uint64_t found = 0;   // rays with a hit; hits[ray] is the ray's first cell
  uint64_t single = 0;  // rays that must be cast separately

  // A round begins when this number of cells is loading or waiting. It is the number that memory
  // can load concurrently (measured). The cells of one more packet may be added before the round
  // begins.
  static constexpr int kRoundCells = 24, kMaxWaiting = kRoundCells + kPacketRays;
  WaitingCell waiting[kMaxWaiting];
  RayDescent descents[kPacketRays];
};

// Casts the job's rays selected by `rays`.
void walk_packet_portable(PacketJob& job, uint64_t rays);
using WalkPacket = void (*)(PacketJob& job, uint64_t rays);
// Returns the same walk for AVX2, which has the same results. Null if it was not compiled or this
// machine cannot run it.
WalkPacket walk_packet_avx2();

}  // namespace voxdag::query
