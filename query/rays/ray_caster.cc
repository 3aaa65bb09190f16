#include "query/rays/ray_caster.h"

#include "query/rays/ray_walk.h"

namespace voxdag::query {

bool RayCaster::cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const {
  if (dag_.empty()) return false;
  const MirroredRay mirrored(ray, static_cast<double>(dag_.resolution()));
  return RayWalk(dag_, mirrored, cone, t_max).run(t_min, hit);
}

bool RayCaster::cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit,
                     uint64_t& steps_left) const {
  if (dag_.empty() || steps_left == 0) return false;
  const MirroredRay mirrored(ray, static_cast<double>(dag_.resolution()));
  RayWalk walk(dag_, mirrored, cone, t_max, steps_left);
  const bool is_hit = walk.run(t_min, hit);
  steps_left = walk.steps_left();
  return is_hit;
}

}  // namespace voxdag::query
