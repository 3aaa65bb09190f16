#include "query/ray_caster.h"

#include "query/ray_walk.h"

namespace voxdag::query {

bool RayCaster::cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) const {
  if (dag_.empty()) return false;
  const MirroredRay mirrored(ray, static_cast<double>(dag_.resolution()));
  return RayWalk(dag_, mirrored, cone, t_max).run(t_min, hit);
}

}  // namespace voxdag::query
