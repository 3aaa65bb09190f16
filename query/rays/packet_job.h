// The rays of a packet that is being cast, and the descent of each ray. RayPacket prepares this
// data, and a walk works on it; see packet_walk.h.
#pragma once

#include <cstdint>

#include "query/dag/dag_view.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {

inline constexpr int kPacketRays = 64;

// A position in voxels, mirrored like the rays. The fourth number has no meaning.
using Int4 = int32_t __attribute__((vector_size(16)));

// A node or brick that a ray may cross. The ray enters it after it has left the cells before it.
struct WaitingCell {
  Int4 low;         // low corner
  uint64_t offset;  // word offset in its level
  uint32_t depth;
  int32_t next;  // next cell of the same ray, or -1
};

// The descent of one ray.
struct RayDescent {
  static constexpr int kMaxLevels = 20;
  Int4 low;  // cell that the ray enters next, as in WaitingCell
  uint64_t offset;
  uint32_t depth;
  // Bit d: the path's node at depth d has more children to visit; d is less than `depth`.
  uint32_t open;
  int32_t first_waiting, last_waiting;   // -1 if no cell waits
  uint8_t left[kMaxLevels];              // children left to visit, mirrored
  const uint32_t* children[kMaxLevels];  // words of the path's nodes after the mask
};

// An origin and the inverse of a direction; the fourth number has no meaning.
struct alignas(64) PacketRay {
  double origin[4], inverse[4];
};

struct PacketJob {
  static constexpr int kMaxLevels = RayDescent::kMaxLevels;
  struct Level {
    const uint32_t* words;
    uint64_t count;
    uint64_t any_node;  // at smaller offsets a node of any size fits in the level
    bool wide_children;
  };

  // The DAG. Cells at `leaf_depth` count as solid; it is at least 1.
  const DagView* dag = nullptr;
  Level levels[kMaxLevels];
  uint32_t grid_levels = 0, leaf_depth = 0;

  // Rays whose directions have the same signs, mirrored so that these are positive.
  int mirror = 0;
  double t_min = 0, t_max = 0;
  alignas(64) double origin[3][kPacketRays], inverse[3][kPacketRays];
  PacketRay rays[kPacketRays];
  Hit* hits = nullptr;
  uint64_t found = 0;   // rays with a hit; hits[ray] is the ray's first cell
  uint64_t single = 0;  // rays that must be cast separately

  // Number of loading or waiting cells that begins a round: as many as memory can load concurrently
  // (measured). One more packet may come first.
  static constexpr int kRoundCells = 24, kMaxWaiting = kRoundCells + kPacketRays;
  WaitingCell waiting[kMaxWaiting];
  RayDescent descents[kPacketRays];
};

// Casts the job's rays selected by `rays`.
void walk_packet_portable(PacketJob& job, uint64_t rays);
using WalkPacket = void (*)(PacketJob& job, uint64_t rays);
// The same for AVX2, with the same results; null if it was not built or this machine cannot run it.
WalkPacket walk_packet_avx2();

}  // namespace voxdag::query
