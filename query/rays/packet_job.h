// The rays of a packet while they are cast, and the cells that wait for them: what RayPacket
// prepares and a walk works on. See packet_walk.h for how.
#pragma once

#include <cstdint>

#include "query/dag_view.h"
#include "query/ray_caster.h"

namespace voxdag::query {

inline constexpr int kPacketRays = 64;

// One ray and a node or brick that it may cross.
struct PacketCell {
  int32_t low[4];   // its low corner in voxels, mirrored as the ray is; the number of the ray
  uint64_t offset;  // in the words of its level
};

// Cells of one depth.
struct PacketCells {
  // A round begins before more wait than there are rays and what is left of the last one.
  static constexpr int kCapacity = 192;
  int count = 0;
  PacketCell cells[kCapacity];
};

// An origin and the inverse of a direction; the fourth number has no meaning.
struct alignas(32) PacketRay {
  double origin[4], inverse[4];
};

struct PacketJob {
  static constexpr int kMaxLevels = 20;
  struct Level {
    const uint32_t* words;
    uint64_t count;
    bool wide_children;
  };

  // The DAG. Cells at `leaf_depth` are hit as a whole; it is at least 1.
  const DagView* dag = nullptr;
  Level levels[kMaxLevels];
  uint32_t grid_levels = 0, leaf_depth = 0;

  // Rays whose directions have the same signs, mirrored so that these are positive.
  int mirror = 0;
  double t_min = 0, t_max = 0;
  alignas(32) double origin[3][kPacketRays], inverse[3][kPacketRays];
  // At this parameter a ray ends: its hit so far, or t_max; less than all if it has been given up.
  alignas(32) double t_end[kPacketRays];
  PacketRay rays[kPacketRays];
  Hit* hits = nullptr;
  uint64_t found = 0;   // rays that have a hit, hits[ray], the first of all cells seen so far
  uint64_t single = 0;  // rays that have been given up: to be cast by themselves

  PacketCells waiting[kMaxLevels];  // by depth
};

// Casts those of the job's rays that are in `rays`.
void walk_packet_portable(PacketJob& job, uint64_t rays);
using WalkPacket = void (*)(PacketJob& job, uint64_t rays);
// The same for AVX2, with the same results; null if it was not built or this machine cannot run it.
WalkPacket walk_packet_avx2();

}  // namespace voxdag::query
