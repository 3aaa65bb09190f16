// What a ray brings back: a matt surface under a sun (in closed rooms, a lamp) and a soft sky, both
// found by casting rays, on a floor that takes the scene's shadow, before a plain background.
#pragma once

#include <vector>

#include "cli/render/bounds.h"
#include "cli/render/camera.h"
#include "cli/render/ray_caster.h"
#include "cli/render/sampling.h"
#include "cli/render/vec.h"

namespace voxdag::render {

class Shader {
 public:
  // Chooses lamp and exposure for what the camera sees. `camera` must outlive the shader.
  Shader(const DagView& dag, const Box& box, const Camera& camera, int width, int height);

  // Linear red, green, blue in [0, 1] at a point of the picture.
  Vec colour(double x, double y, Sampler& sampler) const;

 private:
  struct Surface {
    Vec point;  // from where rays to the light start
    Vec normal;
    double size = 0;  // of the cell, in voxels
    double t = 0;
  };

  bool hit_surface(const Ray& ray, Surface& surface) const;
  Vec lit_surface(const Surface& surface, int sky_rays, Sampler& sampler) const;
  Vec skylight(const Surface& surface, int rays, Sampler& sampler) const;
  // From a point of the lamp that `sampler` picks; none where something is in between.
  Vec lamplight(const Surface& surface, Sampler& sampler) const;
  bool sees_lamp(const Surface& surface, const Vec& lamp) const;
  Vec background(double y) const;
  // How much light reaches the floor where `ray` meets it, 1 where the scene takes none away.
  double floor_light(const Ray& ray, double until, Sampler& sampler) const;

  double lit_share(const std::vector<Surface>& seen, const Vec& lamp) const;
  void choose_lamp(const std::vector<Surface>& seen);
  void choose_exposure(const std::vector<Surface>& seen);

  const DagView& dag_;
  const RayCaster caster_;
  const Camera& camera_;
  const Box box_;
  const double height_;
  bool has_floor_ = false;
  double reach_ = 0;  // how far a surface looks for what takes its skylight, in voxels
  double haze_start_ = 0, haze_depth_ = 1;
  Vec lamp_;               // the sun, far away, or a lamp in a closed room
  double lamp_reach_ = 0;  // where its light has half its strength
  double exposure_ = 1;
};

}  // namespace voxdag::render
