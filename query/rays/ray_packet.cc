#include "query/rays/ray_packet.h"

#include <bit>

#include "query/rays/ray_walk.h"

namespace voxdag::query {

WalkPacket fastest_packet_walk() {
  static const WalkPacket avx2 = walk_packet_avx2();
  return avx2 ? avx2 : walk_packet_portable;
}

RayPacket::RayPacket(const DagView& dag, double stop_size, double t_min, double t_max,
                     WalkPacket walk)
    : dag_(dag), stop_size_(stop_size), walk_(walk) {
  job_.dag = &dag;
  job_.t_min = t_min;
  job_.t_max = t_max;
  const uint32_t levels = job_.grid_levels = job_.leaf_depth = dag.grid_levels();
  if (dag.empty()) return;
  while (job_.leaf_depth > 0 &&
         static_cast<double>(int64_t{2} << (levels - job_.leaf_depth)) <= stop_size)
    --job_.leaf_depth;
  for (uint32_t depth = 0; depth + kBrickLevels <= levels; ++depth) {
    const std::span<const uint32_t> words = dag.level(depth).words;
    const bool wide = depth + kBrickLevels < levels && dag.level(depth + 1).wide;
    const size_t largest_node = 1 + (size_t{8} << wide);
    job_.levels[depth] = {words.data(), words.size(),
                          words.size() >= largest_node ? words.size() - largest_node + 1 : 0, wide};
  }
}

uint64_t RayPacket::cast(std::span<const Ray> rays, Hit* hits) {
  if (dag_.empty() || rays.empty()) return 0;
  job_.hits = hits;
  job_.found = job_.single = 0;
  const uint64_t all = ~uint64_t{0} >> (kRays - rays.size());
  if (job_.leaf_depth == 0) {
    job_.single = all;  // the complete grid counts as solid
  } else {
    load(rays);
    cast_packet(all);
  }
  uint64_t found = job_.found & ~job_.single;
  const RayCaster caster(dag_);
  for (uint64_t left = job_.single; left != 0; left &= left - 1) {
    const int ray = std::countr_zero(left);
    Hit unused;
    if (caster.cast(rays[static_cast<size_t>(ray)], {stop_size_, 0}, job_.t_min, job_.t_max,
                    hits ? hits[ray] : unused))
      found |= uint64_t{1} << ray;
  }
  return found;
}

// Mirrors the rays and inverts their directions like MirroredRay, but with several divisions per
// operation. If there are fewer than kRays rays, the first ray is also stored at the unused
// indices.
void RayPacket::load(std::span<const Ray> rays) {
  const double edge = static_cast<double>(dag_.resolution());
  for (size_t i = 0; i < kRays; ++i) {
    const Ray& ray = rays[i < rays.size() ? i : 0];
    mirrors_[i] = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const bool mirrored = !(ray.direction[axis] >= 0);
      mirrors_[i] |= mirrored ? 4 >> axis : 0;
      job_.origin[axis][i] = mirrored ? edge - ray.origin[axis] : ray.origin[axis];
      job_.inverse[axis][i] = MirroredRay::component(ray.direction[axis]);
    }
  }
  for (double(&inverse)[kRays] : job_.inverse)
    for (double& i : inverse) i = 1 / i;
  for (size_t i = 0; i < kRays; ++i) {
    PacketRay& one = job_.rays[i];
    for (int axis = 0; axis < 3; ++axis) {
      one.origin[axis] = job_.origin[axis][i];
      one.inverse[axis] = job_.inverse[axis][i];
    }
    one.origin[3] = one.inverse[3] = 0;
  }
}

// Calls the walk once for each group of rays whose directions have the same signs.
void RayPacket::cast_packet(uint64_t rays) {
  while (rays != 0) {
    job_.mirror = mirrors_[std::countr_zero(rays)];
    uint64_t alike = 0;
    for (size_t i = 0; i < kRays; ++i) alike |= uint64_t{mirrors_[i] == job_.mirror} << i;
    alike &= rays;
    rays &= ~alike;
    walk_(job_, alike);
  }
}

}  // namespace voxdag::query
