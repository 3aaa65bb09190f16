// Casts up to 64 rays together, with results that are bit-identical to RayCaster's. Neighboring
// rays visit the same large cells. A packet visits each large cell only once, for all rays that can
// cross it (query/rays/packet_walk.h).
//
// A packet takes about 30 KiB. Not thread-safe; each thread needs its own.
#pragma once

#include <cstdint>
#include <span>

#include "query/dag/dag_view.h"
#include "query/rays/packet_job.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {

// Returns the fastest walk that this machine can run. All walks have the same results.
WalkPacket fastest_packet_walk();

class RayPacket {
 public:
  static constexpr size_t kRays = kPacketRays;

  // Cells no larger than `stop_size` voxels count as solid. The DAG must outlive the packet.
  RayPacket(const DagView& dag, double stop_size, double t_min, double t_max,
            WalkPacket walk = fastest_packet_walk());

  // Casts up to kRays rays. Returns a mask: bit i is set if ray i has a hit, which is then in
  // hits[i]. `hits` must have room for one hit per ray. Throws Error{kCorrupt} for a damaged DAG.
  uint64_t cast(std::span<const Ray> rays, Hit* hits);
  // Returns the same mask as cast(), but does not compute the hits.
  uint64_t occluded(std::span<const Ray> rays) { return cast(rays, nullptr); }

 private:
  void load(std::span<const Ray> rays);
  void cast_packet(uint64_t rays);

  const DagView& dag_;
  const double stop_size_;
  const WalkPacket walk_;
  int mirrors_[kRays];
  PacketJob job_;
};

}  // namespace voxdag::query
