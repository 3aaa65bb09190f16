// The light on a surface: a sun (in closed rooms, a lamp) and a soft sky, both found by casting
// rays.
#pragma once

#include <vector>

#include "query/ray_caster.h"
#include "query/render/bounds.h"
#include "query/render/camera.h"
#include "query/render/sampling.h"
#include "query/render/surface.h"

namespace voxdag::query {

class Lighting {
 public:
  // Chooses where the lamp stands for what the camera sees, of which `seen` is a sample.
  Lighting(const DagView& dag, const Box& box, const Camera& camera,
           const std::vector<Surface>& seen);

  // Red, green and blue that come from the sky, 1 from all of an open one.
  Vec skylight(const Surface& surface, int rays, Sampler& sampler) const;
  // Whether a surface sees the point of the lamp that `sampler` picks: 0, or 1 dimmed by distance.
  double lamplight(const Surface& surface, Sampler& sampler) const;
  // The share of the lamp's light that a surface takes which faces along `normal`, 0 to 1.
  double facing_lamp(const Vec& place, const Vec& normal) const;
  // How much light the floor below the scene gets where `ray` meets it, 1 where the scene takes
  // none away, or where there is no floor.
  double floor_light(const Ray& ray, Sampler& sampler) const;

 private:
  bool sees_lamp(const Vec& from, double size, const Vec& lamp) const;
  double lit_share(const std::vector<Surface>& seen, const Vec& lamp) const;
  void place_sun(const std::vector<Surface>& seen, const Vec& back);
  void place_lamp(const Vec& eye, const Vec& back);

  const RayCaster caster_;
  const Box box_;
  const double pixel_spread_;
  bool has_floor_ = false;
  double sky_reach_ = 0;   // how far a surface looks for what takes its skylight, in voxels
  Vec lamp_;               // the sun, far away, or a lamp
  double lamp_reach_ = 0;  // where its light has half its strength
  double lit_ = 0;         // share of what is seen
};

}  // namespace voxdag::query
