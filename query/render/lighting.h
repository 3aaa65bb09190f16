// The light on a surface: a sun that casts shadows, and a sky that nearby surfaces partly hide.
// Both lights are computed by casting rays. Immutable; thread-safe.
#pragma once

#include <vector>

#include "query/rays/ray_caster.h"
#include "query/render/camera.h"
#include "query/render/sampling.h"
#include "query/render/surface_hit.h"
#include "query/render/views.h"

namespace voxdag::query {

class Lighting {
 public:
  // Places the sun. `box` is the box of the occupied cells. If the camera is outside the box and
  // above the box's lower side, a floor below the scene shows the scene's shadow. `seen` has
  // samples of the surface that the camera sees, nearest first. If there is no floor, the sun is
  // placed so that it lights about a third of these samples.
  Lighting(const DagView& dag, const Box& box, const Camera& camera,
           const std::vector<SurfaceHit>& seen);

  // Returns red, green and blue light from the sky, as the mean over `rays` rays. An open sky gives
  // about 1.
  Vec sky_light(const SurfaceHit& surface, int rays, const Sampler& sampler) const;
  // Returns 1 if nothing is between the surface and the point of the sun that `sampler` chooses,
  // else 0.
  double sun_light(const SurfaceHit& surface, const Sampler& sampler) const;
  // Returns the light of sun and sky (red, green and blue) that a surface with this albedo and
  // normal reflects.
  Vec reflected(const Vec& albedo, const Vec& normal, const Vec& sky, double sun) const;
  // Returns the brightness of the floor where `ray` meets it; 1 if there is no floor or no shadow.
  double floor_light(const Ray& ray, const Sampler& sampler) const;

 private:
  bool sees(const SurfaceHit& surface, const Vec& sun) const;
  void place_sun(const std::vector<SurfaceHit>& seen, const Vec& back);

  const RayCaster caster_;
  const Box box_;
  const double pixel_spread_;
  bool has_floor_ = false;
  double sky_reach_ = 0;  // distance in voxels beyond which nothing occludes the sky
  Vec sun_{{0, 1, 0}};    // unit vector toward the sun
};

}  // namespace voxdag::query
