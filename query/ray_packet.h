// Casts up to 64 rays at once, with the results of RayCaster to the last bit. Rays that lie close
// to each other, as those of neighboring pixels do, visit the same large cells: a packet visits
// each once, for all rays that cross it. In a cell that few rays cross, each descends on its own.
//
// A packet enters a cell with a ray whose interval in it is not empty, and the order of the
// children is that in which every ray of the packet passes them. Where two planes are passed at the
// same parameter, which of them counts depends on the path from the root: such a ray is cast by
// itself.
//
// About 50 KiB; not thread-safe, each thread has its own.
#pragma once

#include <cstdint>
#include <span>

#include "query/dag_view.h"
#include "query/ray_caster.h"
#include "query/ray_walk.h"

namespace voxdag::query {

class RayPacket {
 public:
  static constexpr size_t kRays = 64;

  // Cells no larger than `stop_size` voxels are hit as a whole. The DAG must outlive the packet.
  RayPacket(const DagView& dag, double stop_size, double t_min, double t_max)
      : dag_(dag), stop_size_(stop_size), t_min_(t_min), t_max_(t_max) {}

  // Casts up to kRays rays; bit i of the result says whether ray i has a hit, hits[i]. Throws
  // Error{kCorrupt} for a damaged DAG.
  uint64_t cast(std::span<const Ray> rays, Hit* hits);

 private:
  // For each axis the parameters at which the rays pass a plane.
  struct Planes {
    const double* low[3];
    const double* high[3];
  };
  static constexpr int kMaxLevels = 20;

  void load(std::span<const Ray> rays);
  void cast_alike(uint64_t rays);
  void crossing(const Planes& planes, uint64_t rays, uint64_t& inside, uint64_t& touching) const;
  void pass_middle(uint32_t depth, const double (&low)[3], double half, uint64_t rays);
  void visit(uint32_t depth, const double (&low)[3], double size, uint64_t content,
             const Planes& planes, uint64_t rays);
  void walk_apart(uint32_t depth, const double (&low)[3], double size, uint64_t content,
                  const Planes& planes, uint64_t rays);

  const DagView& dag_;
  const double stop_size_, t_min_, t_max_;
  Hit* hits_ = nullptr;
  int mirror_ = 0;       // of the rays that are being cast
  uint64_t ended_ = 0;   // rays that have hit, or are to be cast by themselves
  uint64_t found_ = 0;   // rays that have hit
  uint64_t single_ = 0;  // rays to be cast by themselves
  alignas(16) double origin_[3][kRays], inverse_[3][kRays];
  alignas(16) double low_[3][kRays], high_[3][kRays];  // the grid's
  alignas(16) double middle_[kMaxLevels][3][kRays];    // those of the cells on the path
  MirroredRay mirrored_[kRays];
};

}  // namespace voxdag::query
