// A pinhole camera in voxel units, and where to put one to see a thing whole.
#pragma once

#include <vector>

#include "query/vec.h"

namespace voxdag::query {

struct Placement {
  Vec eye;
  Vec target;
  double fov_degrees = 35;  // from the lower to the upper edge of the picture
};

class Camera {
 public:
  // Throws Error{kInvalidInput} if the eye is on the target or the field of view not in (0, 180).
  Camera(const Placement& placement, int width, int height);

  // Through a point of the picture; (0, 0) is the upper left corner of the upper left pixel.
  Ray ray(double x, double y) const;
  // The width of a pixel at distance 1.
  double pixel_spread() const { return pixel_; }
  const Vec& eye() const { return eye_; }
  const Vec& forward() const { return forward_; }

 private:
  Vec eye_, forward_, right_, up_;
  double pixel_;
  double half_width_, half_height_;  // of the picture, in pixels
};

// Looks from `toward_eye` (need not be of length 1) with all of `points` in the picture's middle,
// from no farther than it takes. At least one point.
Placement see_whole(const std::vector<Vec>& points, const Vec& toward_eye, double fov_degrees,
                    double aspect);

}  // namespace voxdag::query
